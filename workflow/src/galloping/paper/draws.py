"""Fast noise realisations of the paper's study at one setting of the unprinted numbers.

Thresholds, simulator and scores are those of the study; recordings are drawn as the sums that least
squares needs, a hundred times as fast. If states are exact, the noise of the derivatives enters
only through its projections on the library's columns: 35 normal numbers for each equation.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

from galloping.cycles.family import initial_state
from galloping.evaluation.score import Truth, evaluate
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import NO_MODEL_ERRORS, as_findings
from galloping.identification.sparse import stlsq
from galloping.identification.sparse.regression import ReducedRegression
from galloping.line.galerkin import coefficients, make_model
from galloping.model.polynomial import Exponents, PolynomialModel, design_matrix, polynomial_library
from galloping.recording.measurement import Motion, channel_scale
from galloping.results import NOISE, SUBSET
from galloping.streams import make_generator
from galloping.trajectory.simulation import Simulator, time_grid


@dataclass(frozen=True)
class Products:
    """Gram matrices and moments for least squares on k simulated recordings of one motion.

    lengths: (p,) of the library's columns, which are divided by them to limit rounding errors.
    grams: (k, p, p), moments: (k, m, p), inner products of these columns and of them with the m
    derivatives. across: (k, m), part of a derivative that no combination of the columns explains.
    samples: of each recording.
    """

    lengths: np.ndarray
    grams: np.ndarray
    moments: np.ndarray
    across: np.ndarray
    samples: int

    def regressions(
        self, names: tuple[str, ...], terms: tuple[Exponents, ...]
    ) -> list[ReducedRegression]:
        """Return for each recording an equivalent least-squares problem with few rows."""
        m, p = self.moments.shape[1:]
        reduced = []
        for gram, moments, across in zip(self.grams, self.moments, self.across, strict=True):
            triangle = np.linalg.cholesky(gram).T
            library = np.vstack([triangle, np.zeros((m, p))]) * self.lengths
            targets = np.vstack([np.linalg.solve(triangle.T, moments.T), np.diag(across)])
            observations = np.full(m, self.samples)
            reduced.append(ReducedRegression(library, targets, observations, names, terms))
        return reduced


@dataclass(frozen=True)
class _Noise:
    """Noise of recordings. terms: of the candidate library. unit: (n_states,) of a noise level."""

    motion: Motion
    terms: tuple[Exponents, ...]
    unit: np.ndarray

    @cached_property
    def _column_lengths(self) -> np.ndarray:
        return np.linalg.norm(design_matrix(self.motion.states, self.terms), axis=0)


class DerivativeNoise(_Noise):
    """Generator of recordings of one motion with exact states and noisy derivatives."""

    def draw(self, level: float, points: int, rng: np.random.Generator, draws: int = 1) -> Products:
        """Draw recordings with noisy derivatives, all at the same samples of the motion.

        points: number of samples, at random if fewer than all. level: of the noise.
        """
        n, p = self._design_matrix.shape
        if points <= p:
            raise np.linalg.LinAlgError(f"{points} samples do not determine {p} terms")
        gram, moments = self._whole_products
        if points < n:
            is_sampled = np.zeros(n, bool)
            is_sampled[rng.choice(n, size=points, replace=False)] = True
            if points <= n / 2:
                gram, moments = self._products_of_rows(is_sampled)
            else:
                other_gram, other_moments = self._products_of_rows(~is_sampled)
                gram, moments = gram - other_gram, moments - other_moments
        sigma = level * self.unit
        shape = draws, len(sigma), p
        noise = rng.standard_normal(shape) @ np.linalg.cholesky(gram).T
        across = sigma * np.sqrt(rng.chisquare(points - p, size=shape[:2]))
        moments = moments.T + sigma[:, np.newaxis] * noise
        return Products(
            self._column_lengths, np.broadcast_to(gram, (draws, p, p)), moments, across, points
        )

    @cached_property
    def _design_matrix(self) -> np.ndarray:
        theta = design_matrix(self.motion.states, self.terms) / self._column_lengths
        return np.ascontiguousarray(theta)

    @cached_property
    def _whole_products(self) -> tuple[np.ndarray, np.ndarray]:
        return self._products_of_rows(slice(None))

    def _products_of_rows(self, rows: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        theta = self._design_matrix[rows]
        return theta.T @ theta, theta.T @ self.motion.rates[rows]


SMOOTHING_WINDOW = 101  # samples in the window of the Savitzky-Golay filter
SMOOTHING_ORDER = 5  # order of its polynomial


@dataclass(frozen=True)
class VelocityNoise(_Noise):
    """Generator of recordings of one motion with noisy velocities and numerical derivatives.

    Displacements are exact. This is the literal meaning of the paper's sentence: noise is added to
    the velocities, and the left-hand side is the numerical derivative of the states. The derivative
    is that of central differences. has_smooth_rates: or that of a polynomial in a moving window;
    has_smooth_states: the library is then of the smoothed states as well.
    """

    has_smooth_rates: bool = False
    has_smooth_states: bool = False

    def draw(self, level: float, points: int, rng: np.random.Generator, draws: int = 1) -> Products:
        """Draw recordings with noisy velocities, each at its own samples of the motion.

        points: number of samples, at random if fewer than all. level: of the noise.
        """
        parts = [self._draw_products(level, points, rng) for _ in range(draws)]
        lengths = self._column_lengths
        grams, moments, squares = (np.stack(each) for each in zip(*parts, strict=True))
        grams, moments = grams / lengths / lengths[:, np.newaxis], moments / lengths
        combinations = np.linalg.solve(grams, moments.swapaxes(1, 2)).swapaxes(1, 2)
        explained = np.sum(combinations * moments, axis=2)
        across = np.sqrt(np.maximum(squares - explained, 0))
        return Products(lengths, grams, moments, across, points)

    def _draw_products(
        self, level: float, points: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        motion, n = self.motion, len(self.motion.time)
        velocities = len(motion.names) // 2
        states = motion.states.copy()
        noise = rng.standard_normal(states[:, velocities:].shape)
        states[:, velocities:] += level * self.unit[velocities:] * noise
        step = motion.time[1] - motion.time[0]
        smooth = partial(
            savgol_filter, states, SMOOTHING_WINDOW, SMOOTHING_ORDER, delta=step, axis=0
        )
        if self.has_smooth_rates:
            rates = smooth(deriv=1)
        else:
            rates = np.gradient(states, step, axis=0, edge_order=2)
        if self.has_smooth_states:
            states = smooth()
        rows = slice(None) if points >= n else rng.choice(n, size=points, replace=False)
        theta, rates = design_matrix(states[rows], self.terms), rates[rows]
        return theta.T @ theta, rates.T @ theta, np.sum(rates**2, axis=0)


# by name: generator of the noise, and the item of `channel_scale` that is the unit of a level
NOISES_BY_READING: dict[str, tuple[Callable[..., DerivativeNoise | VelocityNoise], int]] = {
    "derivative": (DerivativeNoise, 1),
    "velocity": (VelocityNoise, 0),
    "smoothed velocity": (partial(VelocityNoise, has_smooth_rates=True), 0),
    "smoothed states": (
        partial(VelocityNoise, has_smooth_rates=True, has_smooth_states=True), 0,
    ),
}  # fmt: skip


N_THRESHOLDS = 30  # candidate thresholds, if the data choose one
BATCH_DRAWS = 25  # realisations whose motions are in memory at the same time


@dataclass(frozen=True)
class Amounts:
    """Noise levels and numbers of samples of the recordings that are simulated.

    Whole records have `levels`, subsets of `points` samples have `subset_level`.
    """

    levels: Sequence[float] = (0.01, 0.03, 0.05, 0.1)
    points: Sequence[int] = (1000, 5000, 10000, 30000)
    subset_level: float = 0.05
    duration: float = 300.0
    sampling_rate: float = 100.0
    steady_window: tuple[float, float] = (200.0, 300.0)

    @property
    def cells(self) -> list[tuple[str, float, int]]:
        """Kind, noise level and number of samples of each sort of recording.

        A whole record counts with its number of samples.
        """
        whole = len(time_grid(self.duration, self.sampling_rate))
        cells = [(NOISE, level, whole) for level in self.levels]
        return cells + [(SUBSET, self.subset_level, points) for points in self.points]


def line_motion(
    case: Mapping, duration: float, sampling_rate: float
) -> tuple[Motion, PolynomialModel]:
    """Simulate an overhead line from its initial state; return the motion and the line's model."""
    line = make_model(coefficients(case))
    time = time_grid(duration, sampling_rate)
    moved = Simulator(line.states, line.terms)(line, np.array(initial_state(case)), time)
    return Motion(line.states, time, moved.states, line(moved.states), moved.status), line


def paper_draws(
    case: Mapping,
    *,
    draws: int,
    seed: int,
    name: Sequence[str],
    threshold: float | None,
    path_length: int,
    kinematics: str,
    degree: int,
    amounts: Amounts,
) -> pd.DataFrame:
    """Score the reproduced paper's identification method over random noise realisations.

    case: as of `study.cells.Case.released`. threshold, path_length, kinematics: as of
    `stlsq.fit_raw`. A draw depends on `seed`, `name`, its cell and its number only; one that does
    not determine a model counts as refused. Columns kind, level, points, replicate,
    and those of `evaluation.score.score`. Without noise all draws are equal, and there is one.
    """
    motion, line = line_motion(case, amounts.duration, amounts.sampling_rate)
    terms, true = polynomial_library(len(line.states), degree), line.on_polynomials(degree)
    truth = Truth(true, motion.time, motion.states, amounts.steady_window, motion.status)
    noise, scale = NOISES_BY_READING["derivative"]
    noisy = noise(motion, terms, channel_scale(motion, relative=False)[scale])
    options: Any = {"threshold": threshold, "path_length": path_length, "kinematics": kinematics}
    unbounded = np.full((1, *true.coefficients.shape), np.nan)

    rows = []
    for kind, level, points in amounts.cells:
        numbers = range(draws if level > 0 or kind == SUBSET else 1)
        for start in range(0, len(numbers), BATCH_DRAWS):
            part, models = numbers[start : start + BATCH_DRAWS], []
            for draw in part:
                rng = make_generator(seed, "paper", *name, kind, f"{level:.12g}", points, draw)
                try:
                    (reduced,) = noisy.draw(level, points, rng).regressions(line.states, terms)
                    model = stlsq.fit_raw(reduced, **options)
                except NO_MODEL_ERRORS as error:
                    model = IdentifiedModel.refused(line.states, terms, as_findings(error))
                models.append(model)
            scored, _ = evaluate(truth, {"paper": models}, unbounded)
            cell = {"kind": kind, "level": level, "points": points}
            rows += [{**cell, **row, "replicate": d} for d, row in zip(part, scored, strict=True)]
    return pd.DataFrame(rows).drop(columns="method", errors="ignore")
