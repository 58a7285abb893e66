"""Initial guesses of an identification, in order: time scales, equilibria, terms.

A polynomial model that is shifted along an unmeasured displacement follows velocities and
accelerations as well: the one with its equilibrium at zero, without constants, is chosen.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from galloping.identification.preparation.rate_channels import (
    check_rates,
    with_scales,
    without_offsets,
)
from galloping.identification.preparation.smoothing import unmeasured_displacements
from galloping.identification.preparation.weak_form import (
    Start,
    WeakFit,
    make_start,
    rough_fit,
    weak_fit,
)
from galloping.recording.samples import Recording

TIME_SCALES = (1.0, 1 / 2, 1 / 4)  # shares of the period of the spectrum, in order of trial


def rescale_start(
    start: Start, recordings: list[Recording], share: float
) -> tuple[Start, dict[str, float]]:
    """Estimate unknown scales of channels, and rescale the initial guess by them.

    The measured rates are added. share: of `TIME_SCALES`, for this start. Returns the start in
    these recordings, and the scales, as of `estimate_scales`. Raises IdentificationError if no
    channel determines a scale or an offset, or a rate has another scale than its state.
    """
    scaled, scales = with_scales(recordings, start.period)
    if scales:
        start = make_start(start.problem, scaled, share)
    triples = zip(start.recordings, scaled, start.smoothed, strict=True)
    with_rates = [without_offsets(*each, start.period) for each in triples]
    for one, curves in zip(with_rates, start.smoothed, strict=True):
        check_rates(one, curves)
    return replace(start, recordings=with_rates), scales


def has_free_equilibrium(start: Start) -> bool:
    """Decide whether the equilibrium can be set to zero because no displacement is measured.

    That is, whether each unknown equation is of the velocity of an unmeasured displacement, and no
    constant in it is known to differ from zero.
    """
    problem = start.problem
    constants = [j for j, term in enumerate(problem.terms) if not any(term)]
    known = (problem.known + problem.expected)[np.ix_(problem.unknown, constants)]
    bounds = [ends for _, term, *ends in problem.bounds if not any(term)]
    if np.any(known != 0.0) or any(least > 0.0 or most < 0.0 for least, most in bounds):
        return False
    return set(problem.unknown) <= {v for _, v in _unmeasured_displacements(start)}


def _unmeasured_displacements(start: Start) -> set[tuple[int, int]]:
    """Find each state X that no recording measures, with its velocity dX, as indices."""
    return set.intersection(
        *(set(unmeasured_displacements(one).items()) for one in start.recordings)
    )


def starts_at_equilibria(start: Start) -> Iterator[tuple[str, Start]]:
    """Yield named initial guesses for several positions of the equilibrium.

    They have no constant terms. The curves are used as they are, then shifted by a fifth of the
    standard deviation along each unmeasured displacement: the mean of a motion may be so far from
    the equilibrium. For the line of the study it is 0.15 deviations away; on its accelerations,
    guesses 0.0 to 0.1 deviations off always lead to the model. Raises what `weak_fit` raises.
    """
    problem = start.problem.drop_terms(lambda term: not any(term))  # without constants
    unmeasured = sorted(state for state, _ in _unmeasured_displacements(start))
    units = 0.2 * np.eye(len(problem.states))[unmeasured]
    offsets = (0.0 * units[0], *units, *-units)
    for k, offset in enumerate(offsets, 1):
        curves = [
            replace(one, states=one.states + offset * one.states.std(axis=0))
            for one in start.smoothed
        ]
        fit = weak_fit(problem, curves, start.penalty)
        name = f"equilibrium {k} of {len(offsets)}"
        yield name, replace(start, problem=problem, smoothed=curves, fit=fit)


def starts_of_terms(start: Start) -> Iterator[tuple[str, WeakFit, float]]:
    """Yield initial sets of terms in the order of trial, with names and penalty factors.

    A factor multiplies the penalties at first. A start with few terms moves no faster than the
    samples show: of twenty recordings of the displacements of a line, three samples a second,
    fourteen had no model from starts of 25 to 70 terms; all had one from starts of 4 to 10 terms. A
    start of the second degree diverges less.
    """
    rough, problem = rough_fit(start), start.problem

    def fit_support(support: np.ndarray, penalties: np.ndarray) -> WeakFit:
        selection = problem.select_terms(rough.information, rough.right, [support], penalties)
        free, _ = problem.solve_within_bounds(rough.information, rough.right, selection)
        return replace(rough, free=free, support=selection)

    yield "weak form" if rough is start.fit else "weak form of a telling stretch", rough, 1.0
    # factor on the penalties: of six clear lines that did not settle from the weak form, four
    # settled with 16, each with the right terms, and two with four
    penalty_factor = 16.0
    yield (
        "few terms",
        fit_support(rough.support, penalty_factor * start.penalties.least),
        penalty_factor,
    )
    low = problem.degrees <= 2
    if not low.all():
        yield "second degree", fit_support(low, np.where(low, start.penalties.least, np.inf)), 1.0
