"""Bias of small motions by terms beyond the degree of the library.

At the recorded amplitudes, the terms of a library compensate for terms of higher degree that the
system has and the library lacks. If small motions were not recorded, this biases the coefficients,
and the covariance by noise does not include the bias.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import comb, prod

import numpy as np

from galloping.arrays import round_down
from galloping.behaviour.dynamics import Surroundings
from galloping.behaviour.following import Following, without_outliers
from galloping.cycles.settling import Pace
from galloping.evaluation.bounds import Experiment, fisher_information, weighted_sensitivities
from galloping.identification.drawn_models import draw_models_and_rivals
from galloping.identification.identified_model import RANGE_SUFFIXES, IdentifiedModel
from galloping.identification.inputs import segments_with_inputs
from galloping.identification.no_model import NoModel, attempt
from galloping.inspection.excerpts import excerpts
from galloping.model.polynomial import (
    Exponents,
    PolynomialModel,
    has_functions,
    polynomial_library,
    velocity_pairs,
)
from galloping.progress_reports import passing
from galloping.recording.samples import Recording, mean_inputs, typical_inputs

EXTRA_DEGREES = 2  # degrees beyond that of the library: the next even and the next odd one
SAMPLES_PER_PERIOD = 20  # averaged samples in a period of the fastest motion
MAX_EXTRA_TERMS = 250  # number of terms beyond the library in all equations, at most
MIN_NONLINEAR_SHARE = 1e-12  # smallest nonlinear share of an equation: less is rounding


def with_extrapolation(
    identified: IdentifiedModel, recordings: Sequence[Recording]
) -> IdentifiedModel:
    """Add to a model the effect of missing higher-degree terms on its coefficients.

    The coefficients of these terms have a normal prior, with the deviation that continues the
    nonlinear terms of the model as a geometric series at the size of the recorded motion. Their
    posterior follows from the information matrix of the library and these terms together, and from
    the residuals of the model. The residuals of an approximate model count as noise. recordings:
    those from which the model was identified. Returns the model with `extrapolation_shift` and
    `extrapolation_covariance`.

    The model is unchanged if its library is not the whole polynomial library of a degree, since the
    library is then prior knowledge; if random forces move it, whose motions have all sizes; if the
    motion contains no equilibrium; or if the model cannot be integrated over the recordings.
    """
    model = identified.model
    degree = _find_library_degree(model)
    is_judged = identified.status in ("ok", "not identifiable", "approximate")
    if not (degree and is_judged and velocity_pairs(model.states) and len(identified.covariance)):
        return identified
    means = typical_inputs(model.inputs, recordings)
    steady = model.at(means)
    around = Surroundings.of(recordings)
    if identified.is_forced or (rest := around.rest(steady)) is None:
        return identified
    parts = excerpts(list(recordings))
    segments = attempt(segments_with_inputs, parts, model.inputs) if model.inputs else parts
    if isinstance(segments, NoModel) or len(segments) != len(identified.initial_states):
        return identified
    sizes = around.sizes(steady)
    rates = np.max(np.abs(steady.jacobian(rest[np.newaxis])[0]) * sizes, axis=1)
    unknown = [i for i in range(len(rest)) if i not in identified.known and rates[i] > 0.0]
    terms = _list_further_terms(model.states, degree, len(unknown))
    regression = _Regression(identified, unknown, terms, rest, sizes, rates)
    passing("terms of the next degree")
    results = [
        attempt(regression.make_normal_equations, segment, start)
        for segment, start in zip(segments, identified.initial_states, strict=True)
    ]
    solved = [result for result in results if not isinstance(result, NoModel)]
    if len(solved) < len(results):
        return identified
    drawn = draw_models_and_rivals(identified, np.random.default_rng(0))
    models = [steady, *(each.at(means) for each in drawn)]
    states = np.concatenate([states for *_, states in solved])
    shares = np.max([_compare_nonlinear(each, rest, states) for each in models], axis=0)
    gram, squares, count = (sum(each) for each in list(zip(*solved, strict=True))[:3])
    scaled = gram / max(squares / count, 1.0)
    posterior = attempt(regression.estimate_changes, scaled, shares)
    if isinstance(posterior, NoModel):
        return identified
    shift, covariance = posterior
    return replace(identified, extrapolation_shift=shift, extrapolation_covariance=covariance)


def with_extent(identified: IdentifiedModel, recordings: Sequence[Recording]) -> IdentifiedModel:
    """Add the recorded range of each state to the diagnostics of a model.

    `IdentifiedModel.recorded` returns it.
    """
    around, states = Surroundings.of(recordings), identified.model.states
    extent = {
        f"{state}{end}": float(value)
        for end, values in zip(RANGE_SUFFIXES, (around.low, around.high), strict=True)
        for state, value in zip(states, values, strict=True)
        if np.isfinite(value)
    }
    return replace(identified, diagnostics={**identified.diagnostics, **extent})


def _find_library_degree(model: PolynomialModel) -> int:
    """Determine the degree of a complete polynomial library, 0 for any other library."""
    if any(map(has_functions, model.terms)):
        return 0
    n = len(model.states)
    monomials = {term[:n] for term in model.terms if not any(term[n:])}
    degree = max(map(sum, monomials), default=0)
    return degree if monomials >= set(polynomial_library(n, degree)) else 0


def _list_further_terms(
    states: tuple[str, ...], degree: int, n_equations: int
) -> tuple[Exponents, ...]:
    """List monomials of the next degrees; if many, those of one coordinate and its velocity."""
    library = polynomial_library(len(states), degree + EXTRA_DEGREES)
    terms = [term for term in library if sum(term) > degree]
    if len(terms) * n_equations > MAX_EXTRA_TERMS:
        pairs = [set(pair) for pair in velocity_pairs(states).items()]
        terms = [term for term in terms if any(set(np.flatnonzero(term)) <= pair for pair in pairs)]
    return tuple(terms)


def _compare_nonlinear(model: PolynomialModel, rest: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Compute the ratio of nonlinear to linear part of each equation, (n_states,).

    states: (n, n_states). The parts are about an equilibrium; the ratio is at most one.
    """
    linear = (states - rest) @ model.jacobian(rest[np.newaxis])[0].T
    nonlinear = np.abs(model(states) - model(rest[np.newaxis]) - linear).max(axis=0)
    size = np.abs(linear).max(axis=0)
    return np.minimum(nonlinear, size) / np.maximum(size, np.finfo(float).tiny)


@dataclass(frozen=True)
class _Regression:
    """The coefficients of a model, and those of further terms.

    The further terms are monomials of the distance from `rest`, in `sizes` of the motion, and their
    coefficients are in `rates`, (n_states,) of the linear part of each equation. equations: indices
    of those that have the terms.
    """

    identified: IdentifiedModel
    equations: Sequence[int]
    terms: tuple[Exponents, ...]
    rest: np.ndarray
    sizes: np.ndarray
    rates: np.ndarray

    @cached_property
    def expansion(self) -> tuple[tuple[Exponents, ...], np.ndarray]:
        """Monomials of the states, and their coefficients in each term, (n_terms, n_monomials)."""
        columns: dict[Exponents, int] = {}
        entries = []
        for row, term in enumerate(self.terms):
            for lower in product(*(range(power + 1) for power in term)):
                parts = zip(term, lower, self.rest, self.sizes, strict=True)
                value = prod(comb(m, k) * (-at) ** (m - k) / size**m for m, k, at, size in parts)
                if value:
                    entries.append((row, columns.setdefault(lower, len(columns)), value))
        matrix = np.zeros((len(self.terms), len(columns)))
        for row, column, value in entries:
            matrix[row, column] = value
        return tuple(columns), matrix

    @cached_property
    def extended_model(self) -> tuple[PolynomialModel, np.ndarray]:
        """Model on a library with the further monomials, and its free coefficients.

        The coefficients are (n_free, 2) pairs (equation, term): those of the model, then by
        equation those of the monomials.
        """
        model = self.identified.model
        monomials = [(*term, *(0 for _ in model.inputs)) for term in self.expansion[0]]
        terms = tuple(dict.fromkeys([*model.terms, *monomials]))
        column = {term: j for j, term in enumerate(terms)}
        further = [(i, column[term]) for i in self.equations for term in monomials]
        own = np.argwhere(self.identified.support)  # terms keep their columns
        return model.on_library(terms), np.concatenate([own, np.reshape(further, (-1, 2))])

    def make_normal_equations(
        self, recording: Recording, start: np.ndarray
    ) -> tuple[np.ndarray, float, int, np.ndarray]:
        """Make the normal equations of a recording, linearised about the motion of the model.

        start: (n_states,) of the motion. Returns the normal equations, with the residual after the
        coefficients; sum of squares and number of the averaged samples; and the motion's states (n,
        n_states). Raises FloatingPointError if the model diverges.
        """
        model, recording = self.identified.model, without_outliers(recording)
        follow, n = Following(self.identified, recording), len(model.states)
        time, samples = recording.time, follow.samples
        motion = follow.motion(model, start, time)
        if not np.isfinite(motion).all():
            raise FloatingPointError("the model diverges over the recording")
        steady = model.at(mean_inputs(model.inputs, [recording]))
        fast = Pace.of(steady, self.rest).fast
        length = max(round_down(fast / SAMPLES_PER_PERIOD / recording.step), 1)
        blocks = len(time) // length
        residuals = (samples - motion)[: blocks * length].reshape(blocks, length, -1)
        counts = np.isfinite(residuals).sum(axis=1)
        weight = np.sqrt(counts) * follow.inverse_sigma
        residual = weight * np.nan_to_num(residuals).sum(axis=1) / np.maximum(counts, 1)
        try:
            slopes = self._slopes(recording, start, time[length // 2 :: length][:blocks], follow)
            rows = weight[..., np.newaxis] * slopes
            rows = np.insert(rows, rows.shape[2] - n, residual, axis=2)
            gram = fisher_information(rows, rows.shape[2] - n)
        except ValueError as error:
            raise FloatingPointError(str(error)) from error
        return gram, float(np.sum(residual**2)), int(np.count_nonzero(weight)), motion[:, :n]

    def _slopes(
        self, recording: Recording, start: np.ndarray, time: np.ndarray, follow: Following
    ) -> np.ndarray:
        """Compute the sensitivities of the channels at times (n,), s.

        Returns (n, n_sensed, n_coefficients + n_states).
        """
        extended, free = self.extended_model
        n, n_own = len(start), int(self.identified.support.sum())
        rates = np.full(n, np.inf)
        rates[list(follow.sensed.rates)] = 1.0
        experiment = Experiment(
            start, np.append(recording.time[0], time[time > recording.time[0]]), np.ones(n),
            rates if follow.sensed.rates else None, recording.inputs,
        )  # fmt: skip
        slopes = weighted_sensitivities(extended, free, experiment)[-len(time) :]
        slopes = slopes[:, [*range(n), *(n + k for k in follow.sensed.rates)]]
        of_own, of_further, of_start = np.split(slopes, [n_own, len(free)], axis=2)
        parts = np.split(of_further, len(self.equations), axis=2)
        scaled = [
            part @ (self.rates[i] * self.expansion[1].T)
            for i, part in zip(self.equations, parts, strict=True)
        ]
        return np.concatenate([of_own, *scaled, of_start], axis=2)

    def estimate_changes(
        self, gram: np.ndarray, shares: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Estimate mean and covariance of the coefficient changes by further terms.

        Returns (n_support,) and (n_support, n_support). gram: normal equations of all recordings.
        shares: (n_states,) of the nonlinear part in each equation, the square of the ratio of a
        geometric series.
        """
        n_support, degrees = int(self.identified.support.sum()), np.array([*map(sum, self.terms)])
        ratios = np.maximum(shares[list(self.equations), np.newaxis], MIN_NONLINEAR_SHARE)
        prior = (ratios ** ((1 - degrees) / 2.0)).ravel() ** 2.0
        diagonal = np.diag(gram)[:-1]
        unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        information, right = gram[:-1, :-1] * unit * unit[:, np.newaxis], gram[:-1, -1] * unit
        own, other = np.s_[:n_support], np.s_[n_support:]
        response = -np.linalg.solve(information[own, own], information[own, other])
        further = information[other, other] + information[other, own] @ response
        further += np.diag(prior * unit[other] ** 2)
        root = np.sqrt(np.diag(further))
        covariance = np.linalg.inv(further / root / root[:, np.newaxis])
        covariance = covariance / root / root[:, np.newaxis]
        mean = covariance @ (right[other] + response.T @ right[own])
        response = unit[own, np.newaxis] * response
        return response @ mean, response @ covariance @ response.T
