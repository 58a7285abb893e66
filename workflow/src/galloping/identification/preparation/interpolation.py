"""Interpolation of inputs between their samples, if unspecified: held, linear or smooth.

A controller holds its output until the next sample, and a wind varies smoothly. If it is
interpolated smoothly, a held input seems late by half of its step. The misfit of the weak form
decides, with all candidate terms, so that no nearly correct model is needed.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from galloping.identification.inputs import segments_with_inputs
from galloping.identification.no_model import NO_MODEL_ERRORS
from galloping.identification.preparation.screening import prepare_recordings
from galloping.identification.preparation.smoothing import Smooth
from galloping.identification.preparation.weak_form import weak_fit
from galloping.identification.problem import Problem
from galloping.model.polynomial import exponent_matrix
from galloping.recording.samples import Input, Recording, evaluate_extended

# Least share of the misfit beyond the noise that another interpolation removes. An input that is
# late by less than 0.3 of its step does then not count as held: its misfit, which is quadratic in
# the delay, falls by less.
MIN_MISFIT_FALL = 1.0 / 3.0
# Least variance that neighbouring samples do not predict, of an input that varies between its
# samples, over its whole variance (1.5 if the samples are independent), and over its mean square.
MIN_UNPREDICTED_SHARE, MIN_UNPREDICTED_SQUARE = 0.1, 1e-4
STEP_DIVISIONS = 8  # number of fine steps in a step of the grid; inputs are averaged over each


HasInputs = TypeVar("HasInputs", bound=Any)


def choose_interpolants(problem: Problem, recordings: Sequence[Recording]) -> dict[str, str]:
    """Choose by the data how each input is interpolated between samples: held, linear or cubic.

    Returns the choice, as in `Input.between`, by the name of each input that has alternatives: its
    present interpolation, unless an alternative removes the share MIN_MISFIT_FALL of the misfit
    beyond the noise, and more than the penalty of a term.
    """
    interpolations = {
        name: recordings[0].inputs[name].between
        for name in problem.inputs
        if any(one.inputs[name].alternatives for one in recordings)
    }
    if not interpolations:
        return {}
    try:
        segments = segments_with_inputs(list(recordings), problem.inputs)
        cleaned, smoothed, _ = prepare_recordings(segments)
    except NO_MODEL_ERRORS:
        return interpolations
    penalty = 2.0 * np.log(sum(one.samples for one in cleaned))
    for name, present in interpolations.items():
        fits = {}
        alternatives = (
            each.between for one in recordings for each in one.inputs[name].alternatives
        )
        for kind in dict.fromkeys((present, *alternatives)):
            curves = [
                _with_inputs(one, curve, problem, {**interpolations, name: kind})
                for one, curve in zip(segments, smoothed, strict=True)
            ]
            with suppress(*NO_MODEL_ERRORS):
                fits[kind] = weak_fit(problem, curves, penalty)
        best = min(fits, key=lambda kind: fits[kind].misfit, default=present)
        if fit := fits.get(present):
            least = max(penalty / fit.rows, MIN_MISFIT_FALL * (fit.misfit - 1.0))
            if fit.misfit - fits[best].misfit <= least:
                continue
        interpolations[name] = best
    return interpolations


def held_inputs(problem: Problem, recordings: Sequence[Recording]) -> list[str]:
    """List inputs that the data show to be constant between samples, though specified otherwise."""
    if all(one.inputs[name].between == "zero" for one in recordings for name in problem.inputs):
        return []
    undecided = []
    for one in recordings:
        inputs = {
            name: replace(each, alternatives=(replace(each, between="zero", alternatives=()),))
            for name, each in one.inputs.items()
        }
        undecided.append(replace(one, inputs=inputs))
    kinds = choose_interpolants(problem, undecided)
    return [
        name for name, kind in kinds.items() if kind == "zero" != recordings[0].inputs[name].between
    ]


def undersampled_inputs(recordings: Sequence[Recording], period: float) -> dict[str, float]:
    """Find inputs that vary between samples that are more than a quarter of a period apart.

    They do if neighbouring samples do not predict each sample: fluctuations at the frequencies of
    the motion are lost. period: of the motion, s. Returns the longest step, s, of each, by name.
    """
    steps: dict[str, float] = {}
    for recording in recordings:
        for name, one in recording.inputs.items():
            is_within = (one.time >= recording.time[0]) & (one.time <= recording.time[-1])
            is_used = is_within & np.isfinite(one.values)
            time, values = one.time[is_used], one.values[is_used]
            if one.between == "zero" or len(values) < 3:
                continue
            step = float(np.median(np.diff(time)))
            unpredicted = np.var(values[1:-1] - (values[:-2] + values[2:]) / 2.0)
            varies = unpredicted > MIN_UNPREDICTED_SHARE * np.var(values)
            matters = unpredicted > MIN_UNPREDICTED_SQUARE * np.mean(values**2)
            if step > period / 4.0 and varies and matters:
                steps[name] = max(step, steps.get(name, 0.0))
    return steps


def with_interpolation(given: Input, kind: str) -> Input:
    """Return an input with the given interpolation between its samples."""
    interpolated = {each.between: each for each in (*given.alternatives, given)}
    return replace(interpolated.get(kind, given), alternatives=())


def with_interpolants(recording: HasInputs, kinds: Mapping[str, str]) -> HasInputs:
    """Return a recording, or what else has `inputs`, with other interpolations, by input name."""
    inputs = {
        name: with_interpolation(one, kinds[name]) if name in kinds else one
        for name, one in recording.inputs.items()
    }
    return replace(recording, inputs=inputs)


def _with_inputs(
    recording: Recording, curve: Smooth, problem: Problem, kinds: Mapping[str, str]
) -> Smooth:
    """Add inputs to smooth curves, interpolated by `kinds`, for integrals with test functions.

    A value at a grid point is the integral of the input with a kernel about it. The sum over the
    grid of its product with a smooth function is then the integral of the product, to the third
    order in the step of the grid, however the input varies between the points. An input that the
    library divides by is limited to its range, which a kernel exceeds beside a jump.
    """
    step = (curve.time[1] - curve.time[0]) / STEP_DIVISIONS
    reach = 2 * STEP_DIVISIONS  # of the kernel
    count = (len(curve.time) - 1) * STEP_DIVISIONS + 2 * reach
    fine = curve.time[0] + step * (np.arange(count) - reach + 0.5)
    kernel = _cubic_kernel((np.arange(2 * reach) - reach + 0.5) / STEP_DIVISIONS) / STEP_DIVISIONS
    is_divisor = np.any(exponent_matrix(problem.terms, len(problem.names)) < 0, axis=0)
    columns = []
    for k, name in enumerate(problem.inputs, start=len(problem.states)):
        one = recording.inputs[name]
        one = with_interpolation(one, kinds.get(name, one.between))
        means = one.mean_around(fine, step)
        means = np.where(np.isfinite(means), means, evaluate_extended(one, fine))
        values = sliding_window_view(means, 2 * reach)[::STEP_DIVISIONS] @ kernel
        columns.append(np.clip(values, means.min(), means.max()) if is_divisor[k] else values)
    return replace(curve, inputs=np.column_stack(columns))


def _cubic_kernel(x: np.ndarray) -> np.ndarray:
    """Evaluate the kernel of cubic convolution.

    It reproduces any quadratic from its samples (R. G. Keys, IEEE Trans. Acoust. Speech Signal
    Process. 29, 1981).
    """
    x = np.abs(x)
    near, far = (1.5 * x - 2.5) * x**2 + 1.0, ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    return np.where(x < 1.0, near, np.where(x < 2.0, far, 0.0))
