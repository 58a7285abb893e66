"""Streams of random numbers by name, independent of each other."""

import hashlib

import numpy as np


def make_generator(seed: int, *names: str | int) -> np.random.Generator:
    """Make a random generator from a seed and names; other names give an independent stream.

    Names are such as ("noise", case, protocol, replicate).
    """
    digest = hashlib.sha256("/".join(map(str, names)).encode()).digest()
    words = np.frombuffer(digest, dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence([seed, *map(int, words)]))
