"""Where a recorded motion goes from here, with intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel
from galloping.recording import Recording
from galloping.simulation import Simulator

DRAWS = 100  # of models and starts: the ends of a 90 % band then scatter by a tenth of its width
ITERATIONS = 3  # of Gauss-Newton on the start, which is nearly linear over a few periods
STEP = 1e-5  # of finite differences of the start, relative to each state's size


@dataclass(frozen=True)
class Forecast:
    """time: (n,) s. median, low, high: (n, n_states), the 90 % band of what sensors will show."""

    time: np.ndarray
    median: np.ndarray
    low: np.ndarray
    high: np.ndarray


def forecast(
    identified: IdentifiedModel,
    recording: Recording,
    time: np.ndarray,
    window: float,
    rng: np.random.Generator,
) -> Forecast:
    """Forecast the states at `time` from the last `window` seconds of a recording.

    Each of 100 draws takes coefficients from their covariance, and as its start the state that
    follows the samples of the window best after noise was added to them once more; the noise of a
    sample is part of the band. Draws that diverge are left out. Raises ValueError where there is
    no model, or where most draws diverge.
    """
    if identified.status == "refused":
        raise ValueError(f"there is no model to forecast with: {identified.reason}")
    begin = np.searchsorted(recording.time, recording.time[-1] - window)
    sampled, values = recording.time[begin:], recording.values[begin:]
    sigma = np.nan_to_num(identified.sigma[-1])
    model = identified.model
    simulator = Simulator(model.states, model.terms)
    support = np.argwhere(identified.support)
    root = _root(identified.covariance)
    start = _first_guess(recording, begin)
    ahead = np.concatenate([sampled[-1:], time])
    motions = []
    for _ in range(DRAWS):
        coefficients = model.coefficients.copy()
        if len(root):
            coefficients[tuple(support.T)] += root @ rng.standard_normal(len(root))
        drawn = PolynomialModel(model.states, model.terms, coefficients)
        noisy = values + sigma * rng.standard_normal(values.shape)
        state = _end_state(simulator, drawn, start, sampled, noisy, sigma)
        if state is not None:
            motion = simulator(drawn, state, ahead).states[1:]
            if np.all(np.isfinite(motion)):
                motions.append(motion)
    if len(motions) < DRAWS // 2:
        raise ValueError(f"{DRAWS - len(motions)} of {DRAWS} draws of the model diverge")
    motions = np.array(motions)
    seen = motions + sigma * rng.standard_normal(motions.shape)
    low, high = np.quantile(seen, (0.05, 0.95), axis=0)
    return Forecast(time, np.median(motions, axis=0), low, high)


def _root(covariance: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _first_guess(recording: Recording, begin: int) -> np.ndarray:
    """A state near the sample `begin`: interpolated values, slopes for unmeasured velocities."""
    time, states = recording.time, recording.states
    guess = np.zeros(len(states))
    for k, name in enumerate(states):
        known = np.isfinite(recording.values[:, k])
        if known.any():
            guess[k] = np.interp(time[begin], time[known], recording.values[known, k])
        elif name[1:] in states:
            source = recording.values[:, states.index(name[1:])]
            known = np.isfinite(source)
            near = np.abs(time[known] - time[begin]).argsort()[:9]
            guess[k] = np.polyfit(time[known][near], source[known][near], 1)[0]
    return guess


def _end_state(
    simulator: Simulator,
    model: PolynomialModel,
    start: np.ndarray,
    time: np.ndarray,
    values: np.ndarray,
    sigma: np.ndarray,
) -> np.ndarray | None:
    """State at the end of a window on the motion that follows its samples best."""
    weight = np.where(np.isfinite(values) & (sigma > 0), 1.0 / np.where(sigma > 0, sigma, 1.0), 0.0)
    target = np.nan_to_num(values)
    size = STEP * (np.abs(start) + np.nanstd(target, axis=0) + 1e-6)
    for _ in range(ITERATIONS):
        motion = simulator(model, start, time).states
        if not np.all(np.isfinite(motion)):
            return None
        slopes = [
            (simulator(model, start + size * unit, time).states - motion) / size[k]
            for k, unit in enumerate(np.eye(len(start)))
        ]
        if not np.all(np.isfinite(slopes)):
            return None
        design = np.stack([(slope * weight).ravel() for slope in slopes], axis=1)
        start = (
            start + np.linalg.lstsq(design, ((target - motion) * weight).ravel(), rcond=1e-12)[0]
        )
    motion = simulator(model, start, time).states
    return motion[-1] if np.all(np.isfinite(motion)) else None
