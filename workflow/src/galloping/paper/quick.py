"""Very fast noise realisations of the paper's study for a search, slightly less exact than `draws`.

All draws of a cell are thresholded together, several share the samples of a random subset, and
their models are integrated together by Runge-Kutta steps of 0.05 s, with errors of less than a
thousandth of the amplitude. This is thirty times as fast.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numba
import numpy as np
import pandas as pd

from galloping.evaluation import score
from galloping.identification.sparse import supports
from galloping.model.polynomial import (
    Exponents,
    PolynomialModel,
    factor_monomials,
    polynomial_library,
)
from galloping.paper.draws import N_THRESHOLDS, NOISES_BY_READING, Amounts, Products
from galloping.paper.unknowns import MethodReading
from galloping.recording.measurement import Motion, channel_scale
from galloping.results import DISPLACEMENT_COLUMNS, KNOWN, TERM_DEGREES

STEP_SAMPLES = 5  # samples in a step of the simulation
LANES = 16  # models simulated side by side
DRAWS_PER_SUBSET = 8  # realisations that share the samples of a random subset
FAST_MATH = {"contract", "reassoc", "nsz"}  # numba's options that respect infinities
MAX_STATE_SUM = 60.0  # sum of absolute states (m, m/s) above which a model has diverged


@dataclass(frozen=True)
class QuickStudy:
    """Fast simulation of the reproduced paper's study for one motion of an overhead line.

    amounts: noise levels and numbers of samples.
    """

    motion: Motion
    line: PolynomialModel
    amounts: Amounts

    def draw_scores(
        self,
        method: MethodReading,
        count: int,
        rng: np.random.Generator,
        unsimulated_levels: Sequence[float] = (),
    ) -> pd.DataFrame:
        """Score the paper's method in random noise realisations, one row of a table for each.

        count: number of realisations for each sort of recording. unsimulated_levels: noise levels
        of whole records whose models are not simulated, the slowest step.
        """
        noise, scale = NOISES_BY_READING[method.protocol]
        noisy = noise(self.motion, self.terms, channel_scale(self.motion, method.relative)[scale])
        cells, models = self.amounts.cells, []
        for _, level, points in cells:
            shared = count if points >= len(self.motion.time) else DRAWS_PER_SUBSET
            for k in range(0, count, shared):
                products = noisy.draw(level, points, rng, min(shared, count - k))
                models.append(identify_coefficients(products, method))
        coefficients = np.concatenate(models)
        if method.kinematics == KNOWN:
            rows = [row for row in range(coefficients.shape[1]) if row not in score.DYNAMIC_ROWS]
            coefficients[:, rows] = self.true.coefficients[rows]
        columns: dict[str, Any] = {
            name: np.repeat([cell[k] for cell in cells], count)
            for k, name in enumerate(("kind", "level", "points"))
        }
        columns["replicate"] = np.tile(range(count), len(cells))
        columns.update(self._coefficient_scores(coefficients))
        is_whole = columns["points"] >= len(self.motion.time)
        is_simulated = ~(is_whole & np.isin(columns["level"], unsimulated_levels))
        table = pd.DataFrame(columns)
        # all models at once: those with as many terms move together
        scored = self._motion_scores(coefficients[is_simulated])
        return table.join(pd.DataFrame(scored, index=table.index[is_simulated]))

    @cached_property
    def terms(self) -> tuple[Exponents, ...]:
        """All monomials of the states up to degree three."""
        return polynomial_library(len(self.line.states), 3)

    @cached_property
    def true(self) -> PolynomialModel:
        """True model of the line, on the cubic library."""
        return self.line.on_library(self.terms)

    def _coefficient_scores(self, models: np.ndarray) -> dict[str, list[float]]:
        """Score the coefficients of models (draws, n_states, n_terms)."""
        errors = [
            score.mean_error_by_order(self.true, model, score.DYNAMIC_ROWS) for model in models
        ]
        support_scores = [score.support_scores(self.true, model) for model in models]
        columns = {
            f"mean_error_{order}_percent": [100 * each.get(order, np.nan) for each in errors]
            for order in TERM_DEGREES
        }
        return columns | {
            name: [each[name] for each in support_scores] for name in ("missing", "spurious")
        }

    def _motion_scores(self, models: np.ndarray) -> dict[str, np.ndarray]:
        quality, amplitudes = self._simulate_models(models)
        off = np.abs(amplitudes - self._own_amplitudes) / self._own_amplitudes
        columns = {}
        for k, name in enumerate(DISPLACEMENT_COLUMNS):
            columns[f"r2_{name}"] = quality[:, k]
            columns[f"amplitude_error_{name}_percent"] = 100 * off[:, k]
        return columns

    @cached_property
    def _own_amplitudes(self) -> np.ndarray:
        """Amplitudes of the line itself, (2,), as simulated here."""
        return self._simulate_models(self.true.coefficients[np.newaxis])[1][0]

    def _simulate_models(self, models: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute R2 and amplitude, (draws, 2) each; -inf and inf for a model that diverges."""
        # the first monomial is the constant: nothing makes it, and -1 stands for it
        made = [(0, 0), *factor_monomials(self.terms)[1:]]
        last, lower = np.ascontiguousarray(np.maximum(np.array(made, int), 0).T)
        displacements = list(DISPLACEMENT_COLUMNS.values())
        true = np.ascontiguousarray(self.motion.states[::STEP_SAMPLES, displacements])
        step = STEP_SAMPLES / self.amounts.sampling_rate
        first = round(self.amounts.steady_window[0] / step)
        sums = np.empty((len(models), 4))
        # models with as many terms move together: lanes have all terms that one of them has
        order = np.argsort((models != 0).sum(axis=(1, 2)), kind="stable")
        for start in range(0, len(models), LANES):
            some = order[start : start + LANES]
            lanes = models[np.resize(some, LANES)]
            rows, columns = np.nonzero((lanes != 0).any(axis=0))
            values = np.ascontiguousarray(lanes[:, rows, columns].T)
            lane_sums = _move_lanes(values, rows, columns, lower, last, self.motion.states[0], step,
                          true, first)  # fmt: skip
            sums[some] = lane_sums[: len(some)]
        total = np.sum((true - true.mean(axis=0)) ** 2, axis=0)
        quality = np.where(np.isfinite(sums[:, :2]), 1 - sums[:, :2] / total, -np.inf)
        return quality, sums[:, 2:]


def identify_coefficients(products: Products, method: MethodReading) -> np.ndarray:
    """Compute the coefficients that the paper's method identifies from each of many recordings.

    Returns (k, m, p), as of `Products`. The fixed points are those of `stlsq.fit_raw` and
    `stlsq.fit_normalised`.
    """
    grams, moments, across = products.grams, products.moments, products.across
    lengths, scale = np.ones(grams.shape[::2]), np.ones(across.shape)
    every = np.ones((*moments.shape[:2], 1, moments.shape[2]), bool)
    explained = supports.solve(grams, moments, every)[:, :, 0]
    if method.columns == "normalised":
        lengths = np.sqrt(np.diagonal(grams, axis1=1, axis2=2))
        scale = np.sqrt(np.sum(explained * moments, axis=2) + across**2)
        grams = grams / lengths[:, np.newaxis] / lengths[:, :, np.newaxis]
        moments = moments / lengths[:, np.newaxis] / scale[:, :, np.newaxis]
        explained = explained * lengths[:, np.newaxis] / scale[:, :, np.newaxis]
        across = across / scale
        weights = np.ones(grams.shape[1])
    else:
        weights = 1 / products.lengths
    thresholds = np.array([[method.threshold]] * moments.shape[1], float)
    if method.threshold is None:
        largest = np.abs(explained * weights).max(axis=2, keepdims=True)
        largest = largest if method.columns == "raw" else np.ones_like(largest)
        thresholds = largest * supports.threshold_path(N_THRESHOLDS)
    masks = supports.thresholded_supports(grams, moments, thresholds, weights)
    coefficients = supports.solve(grams, moments, masks)
    if method.threshold is None:
        residual = np.sum(
            (explained[:, :, np.newaxis] - coefficients) * moments[:, :, np.newaxis], axis=3
        )
        rss = across[..., np.newaxis] ** 2 + np.maximum(residual, 0)
        judged = supports.ebic(rss, masks.sum(axis=3), products.samples, grams.shape[1])
        best = judged.argmin(axis=2)[..., np.newaxis, np.newaxis]
        coefficients = np.take_along_axis(coefficients, best, axis=2)
    return (
        coefficients[:, :, 0] * scale[..., np.newaxis] / lengths[:, np.newaxis] / products.lengths
    )


@numba.njit(fastmath=FAST_MATH, cache=True, forceinline=True)
def _fill_rates(x, values, rows, columns, lower, last, monomials, rates):
    """Compute state derivatives of all lanes: x, rates (n_states, LANES), values (terms, LANES)."""
    for j in range(1, len(lower)):
        for lane in range(LANES):
            monomials[j, lane] = monomials[lower[j], lane] * x[last[j], lane]
    rates[:] = 0.0
    for k in range(len(rows)):
        for lane in range(LANES):
            rates[rows[k], lane] += values[k, lane] * monomials[columns[k], lane]


@numba.njit(fastmath=FAST_MATH, cache=True)
def _move_lanes(values, rows, columns, lower, last, start, step, true, first):
    """Integrate lanes together by classical Runge-Kutta: (LANES, 4) of squares and amplitudes.

    true: (n, 2), displacements of the motion at every step, for comparison. first: the step from
    which amplitudes count, at every step and, by Hermite's cubic, between steps.
    """
    monomials = np.ones((len(lower), LANES))
    x = np.empty((len(start), LANES))
    k1, k2, k3, k4 = np.empty_like(x), np.empty_like(x), np.empty_like(x), np.empty_like(x)
    for i in range(len(start)):
        x[i] = start[i]
    lost = np.zeros(LANES)
    squares = np.zeros((2, LANES))
    least, most = np.full((2, LANES), np.inf), np.full((2, LANES), -np.inf)
    _fill_rates(x, values, rows, columns, lower, last, monomials, k1)
    for n in range(len(true)):
        for i in range(2):
            for lane in range(LANES):
                error = x[i, lane] - true[n, i]
                squares[i, lane] += error * error
        if n >= first:
            least, most = np.minimum(least, x[:2]), np.maximum(most, x[:2])
        if n == len(true) - 1:
            break
        _fill_rates(x + 0.5 * step * k1, values, rows, columns, lower, last, monomials, k2)
        _fill_rates(x + 0.5 * step * k2, values, rows, columns, lower, last, monomials, k3)
        _fill_rates(x + step * k3, values, rows, columns, lower, last, monomials, k4)
        y = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        lost = np.where(np.abs(y).sum(axis=0) > MAX_STATE_SUM, 1.0, lost)
        y *= 1.0 - lost
        _fill_rates(y, values, rows, columns, lower, last, monomials, k2)
        if n >= first:
            between = 0.5 * (x[:2] + y[:2]) + step / 8 * (k1[:2] - k2[:2])
            least, most = np.minimum(least, between), np.maximum(most, between)
        x[:] = y
        k1[:] = k2
    found = np.concatenate((squares, (most - least) / 2))
    return np.where(lost > 0, np.inf, found).T
