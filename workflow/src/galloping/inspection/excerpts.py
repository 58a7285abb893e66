"""Stretches of long recordings, which bound the cost of a model."""

from collections.abc import Callable
from typing import Any

import numpy as np

from galloping.arrays import first_from, round_down
from galloping.identification.free_motion.answer import find_free_motion, with_findings
from galloping.identification.free_motion.rest import moving_recordings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import FEWEST, validated_problem
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.preparation.smoothing import shortest_period, with_integrals
from galloping.identification.prior_knowledge import PRIOR
from galloping.identification.random_forces.decision import identify_if_ambient
from galloping.identification.random_forces.start import amplitude_fluctuates
from galloping.model.polynomial import Exponents
from galloping.recording.samples import Recording

STRETCHES = 8  # spread over a long recording
PERIODS = 64  # of the fastest motion, in each
PARTS = 8  # of a stretch, whose sizes are compared
TINY = 1e-9  # deviations of a channel


def excerpts(recordings: list[Recording]) -> list[Recording]:
    """Select informative stretches of long recordings, to limit the cost of identification.

    The stretches are at most STRETCHES of PERIODS in all, but one at least of every recording. A
    longer recording is cut into equal parts. From every other part comes the stretch in which the
    size of the motion varies most, since growth and decay contain information on damping; from the
    others that in which the motion is largest, for the cubic terms. Stretches without gaps are
    preferred. Recordings of which no channel varies above its noise have no period, and stay whole,
    and so do those whose stretches would have fewer than FEWEST samples.
    """
    try:
        period = shortest_period([with_integrals(recording) for recording in recordings])
    except ValueError:
        return recordings
    each = max(STRETCHES // len(recordings), 1)
    parts = [piece for recording in recordings for piece in _choose_pieces(recording, each, period)]
    return parts if sum(len(piece.time) for piece in parts) >= FEWEST else recordings


def identify_excerpts(
    method: Callable[..., IdentifiedModel],
    recordings: list[Recording],
    terms: tuple[Exponents, ...],
    *question: Any,
    **options: Any,
) -> IdentifiedModel:
    """Identify a model from informative stretches of recordings, without times of no motion.

    Free motion, and motion under random forces, of which all parts are equally informative, are
    identified in the whole recordings.
    """
    if "forced" in options:
        return method(recordings, terms, *question, **options)
    moving = moving_recordings(recordings, terms)
    if moving.findings:
        return with_findings(
            identify_excerpts(method, moving.recordings, terms, *question, **options), moving
        )
    if method is maximum_likelihood and find_free_motion(moving.until_rest):
        return method(recordings, terms, *question, **options)
    stretches = excerpts(recordings)
    whole = all(one is other for one, other in zip(stretches, recordings, strict=False))
    if method is not maximum_likelihood or recordings[0].inputs or whole:
        return method(stretches, terms, *question, **options)
    period = shortest_period([with_integrals(each) for each in recordings])
    if amplitude_fluctuates(recordings, period):
        names = ("prior", "coefficients", "allowed")
        about = {"prior": PRIOR} | {name: options[name] for name in names if name in options}
        problem = validated_problem(recordings, terms, *question, **about)
        if identified := identify_if_ambient(problem, recordings):
            return identified
    identified = method(stretches, terms, *question, **options)
    if identified.is_forced:
        every = method(recordings, terms, *question, **options, forced=())
        return every if every.status == "ok" or identified.status != "ok" else identified
    return identified


def _choose_pieces(recording: Recording, count: int, period: float) -> list[Recording]:
    time, length = recording.time, PERIODS * period
    fitting = round_down((time[-1] - time[0]) / length)
    if fitting <= count:
        return [recording]
    edges = first_from(time, time[0] + length / PARTS * np.arange(fitting * PARTS + 1))
    sizes = _part_sizes(with_integrals(recording).values, edges).reshape(fitting, PARTS, -1)
    merits = np.array([np.log(sizes).std(axis=1).sum(axis=1), sizes.mean(axis=(1, 2))])
    gaps = np.searchsorted(edges[::PARTS], np.flatnonzero(np.diff(time) > period), "right") - 1
    broken = np.isin(np.arange(fitting), gaps) | np.any(sizes <= TINY, axis=(1, 2))
    merits[:, broken] = -1.0
    parts = np.array_split(np.arange(fitting), count)
    chosen = [part[np.argmax(merits[n % 2, part])] for n, part in enumerate(parts)]
    pieces = [slice(edges[PARTS * k], edges[PARTS * (k + 1)]) for k in chosen]
    return [recording[own] for own in pieces if own.stop - own.start > 2 * PARTS]


def _part_sizes(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Compute the size of the motion in the parts between `edges`, (n_parts, n_channels).

    values: (n, n_states). edges: (n_parts + 1,) samples. In units of the channel's deviation, TINY
    without samples.
    """
    values = values[:, np.isfinite(values).any(axis=0)]
    known = np.isfinite(values)
    scaled = (values - np.nanmean(values, axis=0)) / np.nanstd(values, axis=0)
    scaled = np.where(known, scaled, 0.0)

    def total(of: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((1, of.shape[1])), np.cumsum(of, axis=0)])
        return np.diff(sums[edges], axis=0)

    share = np.maximum(total(known), 1)
    variance = total(scaled**2) / share - (total(scaled) / share) ** 2
    return np.sqrt(np.maximum(variance, TINY**2))
