"""Streams of random numbers by name, independent of each other."""

import hashlib
from numbers import Integral

import numpy as np


def make_generator(seed: int, *names: str | int) -> np.random.Generator:
    """Make a random generator from a seed and names; other names give an independent stream.

    Names are such as ("noise", case, protocol, replicate). Raises ValueError for another seed than
    a whole number >= 0.
    """
    if not isinstance(seed, Integral) or seed < 0:
        raise ValueError(f"seed: {seed!r:.60}; must be a whole number >= 0")
    digest = hashlib.sha256("/".join(map(str, names)).encode()).digest()
    words = np.frombuffer(digest, dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence([seed, *map(int, words)]))
