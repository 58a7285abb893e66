"""Stretches of long recordings, which bound the cost of a model."""

from collections.abc import Callable
from typing import Any

import numpy as np

from galloping.arrays import first_from, round_down
from galloping.identification.free_motion.answer import find_free_motion, map_findings
from galloping.identification.free_motion.rest import moving_recordings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import MIN_SAMPLES, validated_problem
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.preparation.smoothing import shortest_period, with_integrals
from galloping.identification.prior_knowledge import PRIOR
from galloping.identification.random_forces.decision import identify_if_ambient
from galloping.identification.random_forces.start import amplitude_fluctuates
from galloping.model.polynomial import Exponents
from galloping.recording.samples import Recording

MAX_STRETCHES = 8  # largest number of stretches of all recordings
PERIODS_PER_STRETCH = 64  # length of a stretch, in periods of the fastest motion
N_PARTS = 8  # number of parts of a stretch whose sizes are compared
MIN_SIZE = 1e-9  # smallest size of a motion, in standard deviations of its channel


def excerpts(recordings: list[Recording]) -> list[Recording]:
    """Select informative stretches of long recordings, to limit the cost of identification.

    There are at most MAX_STRETCHES of PERIODS_PER_STRETCH periods in all, but at least one of every
    recording. A longer recording is cut into equal parts. The stretch of every other part is that
    in which the size of the motion varies most, since growth and decay contain information on
    damping. The stretch of the others is that of the largest motion, for the cubic terms. Stretches
    without gaps are preferred. Recordings stay whole if no channel varies above its noise, which
    leaves no period, or if their stretches would have fewer than MIN_SAMPLES samples.
    """
    try:
        period = shortest_period([with_integrals(recording) for recording in recordings])
    except ValueError:
        return recordings
    each = max(MAX_STRETCHES // len(recordings), 1)
    parts = [piece for recording in recordings for piece in _choose_pieces(recording, each, period)]
    return parts if sum(len(piece.time) for piece in parts) >= MIN_SAMPLES else recordings


def identify_excerpts(
    method: Callable[..., IdentifiedModel],
    recordings: list[Recording],
    terms: tuple[Exponents, ...],
    *question: Any,
    **options: Any,
) -> IdentifiedModel:
    """Identify a model from informative stretches of recordings, without times of no motion.

    Free motion, and motion under random forces, are identified in the whole recordings, since all
    parts are equally informative.
    """
    if "forced" in options:
        return method(recordings, terms, *question, **options)
    moving = moving_recordings(recordings, terms)
    if method is maximum_likelihood and find_free_motion(moving.until_rest):
        return method(recordings, terms, *question, **options)
    identified = _identify_moving(method, moving.recordings, terms, *question, **options)
    return map_findings(identified, moving)


def _identify_moving(
    method: Callable[..., IdentifiedModel],
    recordings: list[Recording],
    terms: tuple[Exponents, ...],
    *question: Any,
    **options: Any,
) -> IdentifiedModel:
    """Identify a model from informative stretches of recordings that have no rests."""
    stretches = excerpts(recordings)
    whole = all(one is other for one, other in zip(stretches, recordings, strict=False))
    if method is not maximum_likelihood or recordings[0].inputs or whole:
        return method(stretches, terms, *question, **options)
    period = shortest_period([with_integrals(each) for each in recordings])
    if amplitude_fluctuates(recordings, period):
        names = ("prior", "coefficients", "allowed")
        knowledge = {"prior": PRIOR} | {name: options[name] for name in names if name in options}
        problem = validated_problem(recordings, terms, *question, **knowledge)
        if identified := identify_if_ambient(problem, recordings):
            return identified
    identified = method(stretches, terms, *question, **options)
    if identified.is_forced:
        every = method(recordings, terms, *question, **options, forced=())
        return every if every.status == "ok" or identified.status != "ok" else identified
    return identified


def _choose_pieces(recording: Recording, count: int, period: float) -> list[Recording]:
    time, length = recording.time, PERIODS_PER_STRETCH * period
    fitting = round_down((time[-1] - time[0]) / length)
    if fitting <= count:
        return [recording]
    edges = first_from(time, time[0] + length / N_PARTS * np.arange(fitting * N_PARTS + 1))
    sizes = _measure_parts(with_integrals(recording).values, edges).reshape(fitting, N_PARTS, -1)
    merits = np.array([np.log(sizes).std(axis=1).sum(axis=1), sizes.mean(axis=(1, 2))])
    gaps = np.searchsorted(edges[::N_PARTS], np.flatnonzero(np.diff(time) > period), "right") - 1
    broken = np.isin(np.arange(fitting), gaps) | np.any(sizes <= MIN_SIZE, axis=(1, 2))
    merits[:, broken] = -1.0
    parts = np.array_split(np.arange(fitting), count)
    chosen = [part[np.argmax(merits[n % 2, part])] for n, part in enumerate(parts)]
    pieces = [slice(edges[N_PARTS * k], edges[N_PARTS * (k + 1)]) for k in chosen]
    return [recording[rows] for rows in pieces if rows.stop - rows.start > 2 * N_PARTS]


def _measure_parts(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Compute the size of the motion in the parts between `edges`, (n_parts, n_channels).

    values: (n, n_states). edges: (n_parts + 1,) indices of samples. Sizes are relative to the
    deviation of the channel, and MIN_SIZE without samples.
    """
    values = values[:, np.isfinite(values).any(axis=0)]
    is_finite = np.isfinite(values)
    scaled = (values - np.nanmean(values, axis=0)) / np.nanstd(values, axis=0)
    scaled = np.where(is_finite, scaled, 0.0)

    def total(array: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((1, array.shape[1])), np.cumsum(array, axis=0)])
        return np.diff(sums[edges], axis=0)

    share = np.maximum(total(is_finite), 1)
    variance = total(scaled**2) / share - (total(scaled) / share) ** 2
    return np.sqrt(np.maximum(variance, MIN_SIZE**2))
