"""Models of free motion: the mode of each coordinate, and further modes.

If damped sinusoids follow the motion to the noise, the model is linear, with as many modes as
coordinates. Otherwise the usual search is applied to the motion without its further modes. If
only noise of another kind than white contradicts its model, the approximate model is that of the
usual search. If it finds no model, frequency and damping are determined for each amplitude, and the
model is their mean.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.free_motion.envelope import fit_envelope, strongest_channel
from galloping.identification.free_motion.kinds_of_motion import (
    FreeMotion,
    classify_motion,
    without_further_modes,
)
from galloping.identification.free_motion.rest import MovingRecordings, moving_recordings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import NoModel, NoModelError, attempt
from galloping.identification.oscillations import MIN_MODE_PERIODS, EnvelopePart, FurtherMode
from galloping.identification.postprocessing import fitted_model, prepend_path
from galloping.identification.preparation.smoothing import unmeasured_displacements
from galloping.identification.problem import Problem
from galloping.model.intervals import ERROR_STEP, MIN_SIGNIFICANCE
from galloping.model.polynomial import linear_term, velocity_pairs
from galloping.recording.samples import Recording

MAX_NOISE = 1.2  # largest ratio of the residuals of a linear model to the stated noise
FREE_MOTION = "free motion"  # path of a model in `diagnostics`
# Objections that noise of another kind than white causes to a model with the right terms.
NOISE_CODES = {Code.RESIDUAL_POWER, Code.NOISE_CORRELATED, Code.NOISE_GROWS, Code.TIMES_JITTER}
Search = Callable[[list[Recording]], IdentifiedModel | NoModel]
Approximation = Callable[[list[Recording], tuple[Finding, ...]], IdentifiedModel | NoModel]


def is_of_one_coordinate(recordings: Sequence[Recording]) -> bool:
    """Decide whether the only states of recordings are one coordinate and its velocity."""
    states = recordings[0].states
    return len(states) == 2 and len(velocity_pairs(states)) == 1


def find_free_motion(recordings: Sequence[Recording]) -> FreeMotion | None:
    """Detect freely decaying or growing motion, to be tried before the general search.

    It is tried first for a single coordinate, and for linear motion if displacements are not
    measured. recordings: without rests. Returns None for other motion.
    """
    is_single = is_of_one_coordinate(recordings)
    if not (is_single or unmeasured_displacements(recordings[0])):
        return None
    motion = classify_motion(recordings)
    return motion if motion and (motion.is_linear or is_single) else None


def identify_free_motion(
    problem: Problem,
    motion: FreeMotion,
    recordings: list[Recording],
    search: Search,
    approximate: Approximation,
) -> IdentifiedModel:
    """Identify the equations of a freely decaying or growing motion.

    The motion is linear, or of one coordinate. recordings: those of the motion, with the rest after
    it if it may stick. search: the general search for a model that follows recordings to the noise.
    approximate: the search for an approximate model, given the objections to all others. Raises as
    `identify_linear_motion`.
    """
    if not _can_be_linear(problem, motion):
        raise NoModelError
    if motion.is_linear:
        return identify_linear_motion(problem, motion)
    outcome = attempt(search, recordings)
    if isinstance(outcome, IdentifiedModel):
        motion = replace(motion, own_modes=motion.own_modes[:1], steady_modes=())
    elif motion.further_modes:
        outcome = attempt(search, without_further_modes(motion))
    if isinstance(outcome, IdentifiedModel):
        return prepend_path([FREE_MOTION], with_further_modes(outcome, motion))
    if not motion.decays:
        raise NoModelError  # a growing motion may approach a limit cycle
    if motion.linear_motion:
        return identify_linear_motion(problem, motion.linear_motion)
    codes = {each.code for each in outcome.findings}
    is_noise = bool(codes) and codes <= NOISE_CODES
    if is_noise:
        approximation = approximate(recordings, outcome.findings)
        if isinstance(approximation, IdentifiedModel) and approximation.status == "approximate":
            motion = replace(motion, own_modes=motion.own_modes[:1], steady_modes=())
            return prepend_path([FREE_MOTION], with_further_modes(approximation, motion))
    missing_terms = [each for each in outcome.findings if each.code == Code.TERM_MISSING]
    return _identify_mean_model(problem, motion, outcome.findings if is_noise else missing_terms)


def identify_linear_motion(problem: Problem, motion: FreeMotion) -> IdentifiedModel:
    """Identify the linear equations of a free motion that is a sum of damped sinusoids.

    motion: a linear one. Raises NoModelError if there are fewer modes than coordinates, or if the
    problem asks for more than linear equations; IdentificationError if the modes give no system.
    """
    has_all_modes = len(motion.own_modes) >= len(motion.channels.pairs)
    if not (has_all_modes and _can_be_linear(problem, motion)) or _noise_excess(motion) > MAX_NOISE:
        raise NoModelError
    return _identified_model(problem, motion, *_linear_system_with_covariance(motion))


def _linear_system_with_covariance(motion: FreeMotion) -> tuple[np.ndarray, np.ndarray]:
    """Compute the matrix of the linear system whose modes are those of a motion.

    As many modes as coordinates, with their shapes in the channels, determine the equations of all
    velocities: dx/dt = A x has the modes as eigenvectors. Returns A, (n_states, n_states), and the
    covariance of its entries, row by row, (n_states^2, n_states^2).
    """
    modes, n = motion.modes, len(motion.channels.pairs)
    places = list(motion.own_modes[:n])
    strengths = [
        np.linalg.norm(modes.standardised_amplitudes(k)[places])
        for k in range(len(motion.stretches))
    ]
    index = int(np.argmax(strengths))
    covariance = modes.amplitude_covariance(motion.stretches[index], index, places)
    poles, amplitudes = modes.poles[places], modes.amplitudes[index][places]

    def system(parameters: np.ndarray) -> np.ndarray:
        growths, frequencies, *parts = np.split(parameters, [n, 2 * n, 2 * n + amplitudes.size])
        shapes = (parts[0] + 1j * parts[1]).reshape(amplitudes.shape).T
        return motion.channels.system_with_modes(growths + 1j * frequencies, shapes)

    shapes = amplitudes.ravel()
    best = np.concatenate([poles.real, poles.imag, shapes.real, shapes.imag])
    errors = np.sqrt(np.diag(covariance))
    slopes = np.zeros((len(best), 4 * n * n))
    for k in np.flatnonzero(errors > 0.0):
        step = np.zeros(len(best))
        step[k] = ERROR_STEP * errors[k]
        change = system(best + step) - system(best - step)
        slopes[k] = change.ravel() / (2.0 * step[k])
    return system(best), slopes.T @ covariance @ slopes


def without_omissions(
    identified: IdentifiedModel, recordings: Sequence[Recording]
) -> list[Recording]:
    """Remove from recordings what a model of free motion omits: rest, and additional modes.

    recordings: those of the identification, or newer ones. Returns one recording for each stretch
    of motion between events.
    """
    if identified.is_forced:
        return list(recordings)
    moving = moving_recordings(recordings, identified.model.terms)
    if FREE_MOTION not in str(identified.diagnostics.get("path", "")):
        return moving.recordings
    motion = classify_motion(moving.until_rest)
    if motion is None:
        return moving.recordings
    if identified.diagnostics["path"] == FREE_MOTION and not identified.envelope:
        motion = motion.linear_motion or motion
    return without_further_modes(motion) if identified.further_modes else motion.recordings


def map_findings(identified: IdentifiedModel, moving: MovingRecordings) -> IdentifiedModel:
    """Add findings on when motion begins and ends to a model of a recording's moving parts.

    The findings of `identified` refer to the stretches of `moving`; those of the returned model
    refer to the recordings that the stretches come from. If motion was found to end earlier in a
    stretch, the later end is left out.
    """
    findings = identified.findings
    mapped = [replace(each, recording=moving.origins[each.recording]) for each in findings]
    later = {(each.recording, each.data.get("until_s")) for each in mapped}
    ends = [each for each in moving.findings if (each.recording, each.data["time_s"]) not in later]
    return replace(identified, findings=(*ends, *mapped))


def _can_be_linear(problem: Problem, motion: FreeMotion) -> bool:
    """Decide whether a model of free linear motion solves the problem.

    All stiffness and damping must be unknown, without priors, no term may be infinite along the
    motion, and all sensors must show the size of the motion.
    """
    scales = [one.unknown_scales for one in motion.recordings if one.unknown_scales is not None]
    if np.any(scales) or any(function.name == "inverse" for function in problem.tables.functions):
        return False
    velocities, states = list(motion.channels.pairs.values()), range(len(problem.states))
    linear = {linear_term(state, len(problem.names)) for state in states}
    if not set(velocities).issubset(problem.unknown) or not linear.issubset(problem.terms):
        return False
    is_free = problem.open & (problem.precision == 0.0)
    entries = np.ix_(velocities, [problem.linear(state) for state in states])
    return bool(is_free[entries].all()) and not problem.known[velocities].any()


def _noise_excess(motion: FreeMotion) -> float:
    """Compute the largest ratio of the residuals to the stated noise, zero if none is stated."""
    channels, ratios = motion.channels, [0.0]
    for recording, noise in zip(motion.recordings, motion.modes.noise, strict=True):
        if recording.known_noise is not None:
            of_values, of_rates = recording.known_noise
            stated = np.append(of_values[list(channels.values)], of_rates[list(channels.rates)])
            ratios += (noise / stated)[np.isfinite(noise / stated)].tolist()
    return max(ratios)


def _identify_mean_model(
    problem: Problem, motion: FreeMotion, causes: Sequence[Finding]
) -> IdentifiedModel:
    """Identify the mean linear model of a motion that no model follows, for given causes."""
    modes, mode, names = motion.modes, motion.own_modes[0], motion.channels.names
    parts: list[EnvelopePart] = []
    for index, stretch in enumerate(motion.stretches):
        begin = motion.recordings[index].time[0]
        parts += fit_envelope(stretch, modes, index, mode, names, begin)
    if len(parts) < 2:
        raise NoModelError
    values = np.array([[part.growth, part.frequency] for part in parts])
    errors = np.array([[part.growth_error, part.frequency_error] for part in parts])
    weights = errors**-2 / np.sum(errors**-2, axis=0)
    growth, omega = np.sum(weights * values, axis=0)
    # variance of the parts about their mean, plus that of the mean: parts may agree by chance
    scatter = np.sum(weights * (values - [growth, omega]) ** 2, axis=0)
    spread = np.diag(scatter * len(parts) / (len(parts) - 1) + np.sum(errors**-2, axis=0) ** -1)
    ((coordinate, velocity),) = motion.channels.pairs.items()
    system, by_entry = np.zeros((2, 2)), np.zeros((2, 2, 2))
    system[coordinate, velocity] = 1.0
    system[velocity, [coordinate, velocity]] = -(growth**2) - omega**2, 2.0 * growth
    by_entry[:, velocity, coordinate] = -2.0 * growth, -2.0 * omega
    by_entry[0, velocity, velocity] = 2.0
    slopes = by_entry.reshape(2, 4)
    covariance = slopes.T @ spread @ slopes
    identified = _identified_model(problem, motion, system, covariance)
    changing = Finding.of(Code.NOT_EXPONENTIAL, problem.states[coordinate])
    return replace(identified, envelope=tuple(parts)).with_findings(*causes, changing)


def _identified_model(
    problem: Problem, motion: FreeMotion, system: np.ndarray, covariance: np.ndarray
) -> IdentifiedModel:
    """Make the model of a linear system (n_states, n_states) with the covariance of its entries.

    Raises NoModelError if a coefficient is out of its bounds, or the library lacks the constants of
    a motion about another position than zero.
    """
    n = len(system)
    equilibrium, equilibrium_errors = np.zeros((2, n))
    for coordinate in motion.channels.pairs:
        value, error = _estimate_equilibrium(motion, coordinate)
        equilibrium[coordinate], equilibrium_errors[coordinate] = value, error
    is_displaced = np.abs(equilibrium) > MIN_SIGNIFICANCE * equilibrium_errors
    equilibrium = np.where(is_displaced, equilibrium, 0.0)
    constant = (0,) * len(problem.names)
    terms = {problem.linear(state): state for state in range(n)}
    if is_displaced.any():  # only constants in the equations of velocities shift the equilibrium
        constant_index = problem.terms.index(constant) if constant in problem.terms else None
        is_shifted = np.abs(system @ equilibrium) > 0.0
        if constant_index is None or not problem.open[is_shifted, constant_index].all():
            raise NoModelError
        terms[constant_index] = n
    whole = np.zeros((n * n + n,) * 2)  # covariance of the entries and of the equilibrium
    whole[: n * n, : n * n], whole[n * n :, n * n :] = covariance, np.diag(equilibrium_errors**2)
    free, support = np.zeros(len(problem.candidates)), np.zeros(len(problem.candidates), bool)
    slopes = np.zeros((len(free), len(whole)))
    for k, (row, term) in enumerate(problem.candidates):
        if row not in motion.channels.pairs.values() or term not in terms:
            continue
        support[k], state = True, terms[term]
        entries = slice(row * n, (row + 1) * n)
        if state == n:
            free[k] = -system[row] @ equilibrium
            slopes[k, entries], slopes[k, n * n :] = -equilibrium, -system[row]
        else:
            free[k], slopes[k, row * n + state] = system[row, state], 1.0
    if np.any((free < problem.coefficient_bounds[0]) | (free > problem.coefficient_bounds[1])):
        raise NoModelError
    slopes = slopes[support]
    sigma, noise_of_rates = motion.channels.noise_by_state(motion.modes.noise)
    identified = fitted_model(
        problem,
        free,
        support,
        slopes @ whole @ slopes.T,
        initial_states=_initial_states(motion, equilibrium),
        sigma=sigma,
        chi2=1.0,
        diagnostics={**noise_of_rates, "path": FREE_MOTION},
    )
    identified = replace(identified, unconditional_errors=identified.standard_errors)
    return with_further_modes(identified, motion)


def with_further_modes(identified: IdentifiedModel, motion: FreeMotion) -> IdentifiedModel:
    """Add the additional modes and findings of a free motion to its identified model."""
    modes, first, steady = motion.modes, motion.modes.first_fitted, []
    for mode_index in motion.steady_modes:
        channel = strongest_channel(modes, first, mode_index)
        finding = Finding.of(
            Code.FORCED_STEADILY, motion.channels.names[channel],
            frequency_hz=modes.poles[mode_index].imag / (2.0 * np.pi),
            frequency_error_hz=modes.frequency_errors[mode_index] / (2.0 * np.pi),
            amplitude=abs(modes.amplitudes[first][mode_index, channel]),
        )  # fmt: skip
        steady.append(finding)
    longest = max(one.duration for one in motion.stretches)
    further = [
        mode
        for mode_index in motion.further_modes
        if modes.poles[mode_index].imag * longest > 2.0 * np.pi * MIN_MODE_PERIODS
        for index in range(len(motion.recordings))
        for mode in _further_modes(motion, index, mode_index)
    ]
    return replace(identified, further_modes=tuple(further)).with_findings(
        *motion.findings, *steady
    )


def _further_modes(motion: FreeMotion, index: int, mode_index: int) -> Iterator[FurtherMode]:
    """Yield a mode of a stretch, in each coordinate that is measured."""
    modes, states = motion.modes, motion.recordings[0].states
    pole = modes.poles[mode_index]
    for coordinate in motion.channels.pairs:
        amplitude = _modal_displacement(motion, index, mode_index, coordinate)
        if amplitude is not None:
            yield FurtherMode(
                index, states[coordinate], float(pole.imag), float(pole.real),
                float(amplitude.real), float(-amplitude.imag),
                float(modes.frequency_errors[mode_index]), float(modes.growth_errors[mode_index]),
            )  # fmt: skip


def _modal_displacement(
    motion: FreeMotion, index: int, mode_index: int, coordinate: int
) -> complex | None:
    """Compute the amplitude of a mode in a coordinate at the first sample of a stretch.

    It is from the channel with the highest signal-to-noise ratio; None if nothing measures the
    coordinate.
    """
    modes, amplitudes = motion.modes, motion.modes.amplitudes[index][mode_index]
    orders = dict(motion.channels.derivatives(coordinate))
    channels = [c for c in orders if np.isfinite(modes.noise[index, c])]
    if not channels:
        return None
    channel = max(channels, key=lambda c: abs(amplitudes[c]) / modes.noise[index, c])
    return complex(amplitudes[channel] / modes.poles[mode_index] ** orders[channel])


def _estimate_equilibrium(motion: FreeMotion, coordinate: int) -> tuple[float, float]:
    """Estimate the equilibrium of a coordinate and its standard error, zero if not measured."""
    if coordinate not in motion.channels.values:
        return 0.0, 0.0
    channel = motion.channels.values.index(coordinate)
    stepped = any(each.code == Code.FORCE_STEPPED for each in motion.findings)
    first = int(np.argmax(np.isfinite(motion.modes.offset_errors[:, channel])))
    stretches = slice(first, first + 1) if stepped else slice(None)
    offsets = motion.modes.offsets[stretches, channel]
    errors = motion.modes.offset_errors[stretches, channel]
    if not np.isfinite(errors).any():  # too few samples in every stretch
        return 0.0, 0.0
    weights = errors**-2 / np.nansum(errors**-2)
    return float(np.nansum(weights * offsets)), float(np.nansum(errors**-2) ** -0.5)


def _initial_states(motion: FreeMotion, equilibrium: np.ndarray) -> np.ndarray:
    """Compute the initial states of the coordinates' own modes, (n_stretches, n_states)."""
    pairs = motion.channels.pairs
    states = np.tile(equilibrium, (len(motion.stretches), 1))
    for index in range(len(states)):
        for mode_index in motion.own_modes[: len(pairs)]:
            for coordinate, velocity in pairs.items():
                amplitude = _modal_displacement(motion, index, mode_index, coordinate) or 0.0
                states[index, coordinate] += np.real(amplitude)
                states[index, velocity] += np.real(amplitude * motion.modes.poles[mode_index])
    return states
