"""Fits to recordings with known truth: a tidy row for each fit."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from galloping.evaluation.bounds import bounds_of, on_library
from galloping.identification.cell import identify
from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.work import limit_work
from galloping.model.intervals import NORMAL_95
from galloping.model.polynomial import Exponents, PolynomialModel, velocity_pairs
from galloping.recording.measurement import Motion, noises_of, recordings_of
from galloping.recording.samples import Recording
from galloping.trajectory.simulation import rates_along

MAX_COEFFICIENT_DISTANCE = 4.0  # largest distance from the truth, in standard errors


@dataclass(frozen=True)
class Attempt:
    """One recording of a known system, with the true model, for a test of identification.

    columns: that name it in a table. true: on the candidate library. deviations: (n_states,
    n_terms) at the Cramér-Rao bound, of the true terms, NaN elsewhere; None if not computed.
    causes: codes of findings that name the fault of the recording, none without a fault.
    """

    columns: Mapping[str, Any]
    true: PolynomialModel
    recording: Recording
    deviations: np.ndarray | None = None
    causes: frozenset[Code] = frozenset()


def simulate_recording(
    columns: Mapping[str, Any], true: PolynomialModel, time: np.ndarray, states: np.ndarray
) -> Attempt:
    """Simulate one noisy recording of a given motion of a known system.

    The motion is (n, n_states); the recording is as specified by its columns. columns: among them
    `protocol`, `level`, in standard deviations of each state for the protocols that measure states,
    and `seed`; the noise follows from all of them.
    """
    ((recording,),) = recordings_of(
        [_as_motion(true, time, states)], protocol=columns["protocol"], level=columns["level"],
        relative=True, samples=len(time), recordings=1, replicates=1, seed=columns["seed"],
        name=[str(value) for value in columns.values()],
    )  # fmt: skip
    return Attempt(columns, true, recording)


def deviations_at_the_bound(attempt: Attempt, states: np.ndarray) -> np.ndarray:
    """Compute the Cramér-Rao standard deviations of all coefficients for one test recording.

    states: (n, n_states), the motion that was measured. NaN throughout if the motion is too
    sensitive for a bound.
    """
    true, columns = attempt.true, attempt.columns
    motion = _as_motion(true, attempt.recording.time, states)
    noises = noises_of([motion], columns["protocol"], columns["level"], True)
    equations = sorted(set(range(len(true.states))) - set(velocity_pairs(true.states)))
    try:
        (bounds,) = bounds_of(true, equations, [motion], noises, [[slice(None)]])
    except ValueError:
        return np.full(true.coefficients.shape, np.nan)
    return on_library(true, bounds)


def _as_motion(true: PolynomialModel, time: np.ndarray, states: np.ndarray) -> Motion:
    return Motion(true.states, time, states, rates_along(true, states))


def identify_attempts(
    attempts: Iterable[Attempt], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """Identify each test recording with each method; yield a row of results for each fit.

    Its columns are those of the attempt, of `identify_once` and of `against_truth`. methods:
    `Method.settings` by name. min_coefficient_over_bound: the least |coefficient| / deviation of
    the true terms. error_over_bound: root mean square over the true terms of error / deviation, NaN
    unless the terms are exactly right. fault_diagnosed: 1 if a finding names the cause and 0 if
    none does, NaN without a cause.
    """
    for attempt in attempts:
        true, name = attempt.true, list(map(str, attempt.columns.values()))
        for method, settings in methods.items():
            recordings = [attempt.recording]
            result, answer = identify_once({method: settings}, recordings, true.terms, name)
            row = against_truth(true, result)
            weakest, error = np.nan, np.nan
            if attempt.deviations is not None and np.any(np.isfinite(attempt.deviations)):
                places = np.isfinite(attempt.deviations)
                deviations = attempt.deviations[places]
                weakest = np.min(np.abs(true.coefficients[places]) / deviations)
                if row["exact_support"]:
                    off = (result.model.coefficients - true.coefficients)[places]
                    error = np.sqrt(np.mean((off / deviations) ** 2))
            yield {
                **attempt.columns,
                **answer,
                **row,
                "min_coefficient_over_bound": float(weakest),
                "error_over_bound": float(error),
                "fault_diagnosed": (
                    float(result.has_finding(*attempt.causes)) if attempt.causes else np.nan
                ),
            }


def identify_once(
    method: Mapping[str, Mapping],
    recordings: Sequence[Recording],
    terms: tuple[Exponents, ...],
    name: Sequence[str],
) -> tuple[IdentifiedModel, dict[str, object]]:
    """Identify one model with a given method, and return it with a row that describes it.

    The row has `method` and the columns of `describe_answer` and `counted_cost`. method: a name and
    its `Method.settings`. name: of the recordings, for random numbers.
    """
    with counted_cost(recordings) as cost:
        ((found,),) = identify(method, [recordings], terms, name).values()
    return found, {"method": next(iter(method)), **describe_answer(found), **cost}


@contextmanager
def counted_cost(recordings: Sequence[Recording]) -> Iterator[dict[str, float]]:
    """Measure the computing cost of the identification in a `with` block.

    Yields a dict that is filled at the end of the block: `work`, s, counted by
    `identification.work`, and `seconds` of the processor.
    """
    cost: dict[str, float] = {}
    start = process_time()
    with limit_work(recordings, np.inf) as work:
        yield cost
    cost |= {"work": work.spent, "seconds": process_time() - start}


def describe_answer(identified: IdentifiedModel) -> dict[str, object]:
    """Describe an identified model by columns of a table, such as status and coefficients.

    Further columns: findings, their codes; path. coefficients: see `coefficients_as_text`.
    """
    return {
        "status": identified.status, "findings": identified.codes,
        "path": identified.diagnostics.get("path", ""),
        "coefficients": coefficients_as_text(identified),
    }  # fmt: skip


def coefficients_as_text(identified: IdentifiedModel) -> str:
    """Format the coefficients and standard errors of a model as JSON, by equation and term.

    An error that is not stated is null. A refused model has no equations.
    """
    model = identified.model
    equations: dict[str, dict[str, list[float | None]]] = {}
    for i, j in np.argwhere(identified.support):
        value, error = model.coefficients[i, j], identified.standard_errors[i, j]
        stated = float(f"{error:.4g}") if np.isfinite(error) else None
        term = {model.term_names[j]: [float(f"{value:.9g}"), stated]}
        equations.setdefault(model.states[i], {}).update(term)
    return json.dumps(equations, separators=(",", ":"))


def trial_of(attempts: Callable[..., Iterator[Attempt]]) -> Callable[..., Iterator[dict]]:
    """Turn a generator of test recordings into an experiment that identifies them all.

    The trial yields a row for each fit, see `identify_attempts`. attempts: makes its recordings
    from the seed, the case, the replicates and the kind's options.
    """

    def trial(
        seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping], **options
    ) -> Iterator[dict[str, object]]:
        return identify_attempts(attempts(seed, case, replicates, **options), methods)

    return trial


def draw_log_uniform(
    rng: np.random.Generator, ends: tuple[float, float], size: int | None = None
) -> Any:  # an array, or a number without a size
    """Draw numbers whose logarithms are uniformly distributed between those of two ends."""
    low, high = np.log(ends)
    return np.exp(rng.uniform(low, high, size))


def against_truth(true: PolynomialModel, result: IdentifiedModel) -> dict[str, object]:
    """Compare an identified model with the true one: counts of wrong terms and coefficients.

    true: on the library of `result`. Without a model nothing is counted. `ok_and_wrong`: an `ok`
    model that has a false term, lacks a term above its stated limit, or has a coefficient more than
    four unconditional standard errors off. `beyond_4_standard_errors_given_terms`: coefficients
    that are more than four standard errors off, for errors that assume the terms.
    """
    terms = true.support.copy()
    terms[list(result.known)] = False
    present, is_model = result.support, result.status != "refused"
    conditional, errors = result.standard_errors, result.unconditional_errors
    distance = np.abs(result.model.coefficients - true.coefficients)
    is_large, both = np.abs(true.coefficients) > result.detection_limits, terms & present
    groups = {
        "spurious_terms": present & ~terms,
        "missing_above_limit": terms & ~present & is_large,
        "beyond_4_standard_errors": present & (distance > MAX_COEFFICIENT_DISTANCE * errors),
        "beyond_4_standard_errors_given_terms": present
        & (distance > MAX_COEFFICIENT_DISTANCE * conditional),
        "terms": terms,
        "terms_found": both,
        "covered_given_terms": both & (distance <= NORMAL_95 * conditional),
        "covered_unconditional": terms & (distance <= NORMAL_95 * errors),
    }
    counts = {name: int(np.sum(which & is_model)) for name, which in groups.items()}
    faults = ("spurious_terms", "missing_above_limit", "beyond_4_standard_errors")
    wrong = any(counts[name] for name in faults)
    ratios = (errors / conditional)[present & is_model]
    return {
        "exact_support": bool(np.array_equal(present, terms)),
        "ok_and_wrong": bool(result.status == "ok" and wrong),
        **counts,
        "width_ratio": float(np.median(ratios)) if ratios.size else np.nan,
    }
