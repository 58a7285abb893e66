"""Streams of random numbers by name: each the same whatever else is drawn.

A module apart, since the rooms that draw numbers share nothing else.
"""

import hashlib

import numpy as np


def make_generator(seed: int, *names: str | int) -> np.random.Generator:
    """Generator of the study seed and a name such as ("noise", case, protocol, cell, replicate)."""
    digest = hashlib.sha256("/".join(map(str, names)).encode()).digest()
    words = np.frombuffer(digest, dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence([seed, *map(int, words)]))
