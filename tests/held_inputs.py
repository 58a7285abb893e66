"""Recordings of an oscillator under inputs that are held or smooth between their samples."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.ndimage import gaussian_filter1d

STEP, COUNT = 0.02, 1501  # s, samples
TIME = STEP * np.arange(COUNT)
STIFFNESS, DAMPING = 9.87, 0.188  # 1/s^2, 1/s: 0.5 Hz, 3 % of critical
FINE = 20  # steps of the motion, in one between samples


def stays(values: np.ndarray, length: int) -> np.ndarray:
    """Each value for `length` samples."""
    return np.repeat(values, length)[:COUNT]


def inputs() -> dict[str, tuple[np.ndarray, str]]:
    """Samples of inputs by name, and what they are between these."""
    rng = np.random.default_rng(7)
    return {
        "one step": (np.where(TIME >= 4.0, 2.0, 0.0), "zero"),
        "a late step": (np.where(TIME >= 15.0, -1.0, 0.5), "zero"),
        "a pulse": (np.where((TIME > 5.0) & (TIME < 5.5), 8.0, 0.0), "zero"),
        "stairs": (0.7 * np.floor(TIME / 6.0), "zero"),
        "a square wave": (stays(rng.integers(0, 2, 110) * 2.0, 15), "zero"),
        "a controller": (5.0 * rng.standard_normal(COUNT), "zero"),
        "a slow controller": (
            stays(3.0 * gaussian_filter1d(rng.standard_normal(310), 2.0), 5), "zero"
        ),
        "smooth": (8.0 * gaussian_filter1d(rng.standard_normal(COUNT), 15.0), "cubic"),
    }  # fmt: skip


def moved_by(samples: np.ndarray, between: str, noise: float = 0.0) -> np.ndarray:
    """Displacements of q'' = -STIFFNESS q - DAMPING q' + F from rest, with relative noise.

    The motion is exact for an input that is held over a FINE-th of a step.
    """
    time = STEP / FINE * (np.arange(FINE * (COUNT - 1)) + 0.5)
    is_held = between == "zero"
    force = np.repeat(samples[:-1], FINE) if is_held else CubicSpline(TIME, samples)(time)
    system = np.zeros((3, 3))
    system[:2] = [[0.0, 1.0, 0.0], [-STIFFNESS, -DAMPING, 1.0]]
    forward = expm(system * STEP / FINE)[:2]
    state, motion = np.zeros(2), np.zeros((len(force) + 1, 2))
    for k, own in enumerate(force):
        state = forward @ [*state, own]
        motion[k + 1] = state
    seen = motion[::FINE, 0]
    return seen + noise * np.std(seen) * np.random.default_rng(1).standard_normal(COUNT)
