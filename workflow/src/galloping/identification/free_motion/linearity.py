"""Decide which damped sinusoids are modes, and whether their motion is linear.

Damped sinusoids also follow nonlinear motion to some extent: several of about the same frequency,
and harmonics. They are distinguished from modes here.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from galloping.identification.free_motion.damped_modes import DampedModes, Stretch, fit_poles
from galloping.identification.free_motion.mode_search import is_close, is_part_of
from galloping.model.intervals import FALSE_ALARM_RATE, MIN_SIGNIFICANCE

# Largest change of the log amplitude of a steady oscillation over its length. A damping of 0.02 %
# of critical causes a larger change.
MAX_STEADY_CHANGE = 0.02
MIN_STEADY_PERIODS = 20.0  # least length of a steady oscillation, in periods
# Least initial amplitude of a decay that shows a force, relative to the steady oscillation of the
# same frequency. A limit cycle is approached by a decay as well. From so far inside the cycle the
# decay is not exponential; from outside it has the phase and frequency of the steady oscillation.
MIN_TRANSIENT = 0.5
# Harmonic that quadratic stiffness causes. Cubic terms affect the main frequency.
HARMONIC = 2
MAX_HARMONIC = 5  # highest harmonic of a limit cycle that is searched for
# Largest damping ratio of a mode that is separate from non-exponential motion, and largest error
# of this ratio.
MAX_SEPARATE_DAMPING = 0.1


def resolved_modes(stretches: Sequence[Stretch], modes: DampedModes, is_noise: bool) -> list[int]:
    """Select modes whose frequencies differ clearly from those of all stronger modes.

    A sinusoid that differs from a mode in its growth alone shows nonlinear motion; but a steady
    oscillation and a large decaying one are a force and its transient. modes: fitted to the
    stretches. is_noise: whether the residuals are noise. Returns the indices of the modes, that
    with most energy first.
    """
    indices: list[int] = []
    longest = max(one.duration for one in stretches)
    for k in np.argsort(-mode_energies(stretches, modes)):
        unresolved = [j for j in indices if _is_unresolved(modes, int(k), j, longest)]
        if not unresolved or (is_noise and _is_transient(stretches, modes, int(k), unresolved)):
            indices.append(int(k))
    return indices


def _is_unresolved(modes: DampedModes, k: int, j: int, longest: float) -> bool:
    one, other = modes.poles[[k, j]]
    width = max(np.pi / longest, 0.5 * (abs(one.real) + abs(other.real)))
    return abs(one.imag - other.imag) < width


def _is_transient(
    stretches: Sequence[Stretch], modes: DampedModes, k: int, unresolved: list[int]
) -> bool:
    """Decide whether two modes of one frequency are a steady oscillation and its transient."""
    if len(unresolved) != 1:
        return False
    steady = [each for each in (k, *unresolved) if is_steady(stretches, modes, each)]
    if len(steady) != 1:
        return False
    pair = [k if steady == unresolved else unresolved[0], *steady]
    begin, oscillation = modes.standardised_amplitudes(modes.first_fitted)[pair]
    detuning = abs(np.diff(modes.poles[pair].imag)[0])
    is_same = detuning < MIN_SIGNIFICANCE * np.linalg.norm(modes.frequency_errors[pair])
    if is_same and np.vdot(oscillation, begin).real > 0.0:
        return False
    is_large = np.linalg.norm(begin) > MIN_TRANSIENT * np.linalg.norm(oscillation)
    return bool(modes.poles[pair[0]].real < 0.0 and is_large)


def has_linear_modes(
    stretches: Sequence[Stretch], modes: DampedModes, order: Sequence[int], n_coordinates: int
) -> bool:
    """Decide whether fitted damped sinusoids are the modes of a linear motion.

    The residuals of the fit are noise. modes: fitted to the stretches. order: indices of the
    resolved modes, that with most energy first.
    """
    own_modes = [k for k in order if not is_steady(stretches, modes, k)]
    if len(order) < len(modes.poles):
        return False
    if not own_modes:
        return True
    if _has_opposite_growth(modes, own_modes) or _grows_in_parts(modes, own_modes, n_coordinates):
        return False
    gains, freedom = amplitude_gains(stretches, modes, own_modes[0])
    return not gains.max() > chdtri(max(freedom, 1), FALSE_ALARM_RATE / len(gains))


def may_be_single(stretches: Sequence[Stretch], modes: DampedModes, order: Sequence[int]) -> bool:
    """Decide whether several fitted modes may be parts of a single nonlinear oscillation.

    Such a part has about the frequency of the strongest, or a multiple of it by a quadratic term.
    """
    own_modes = [k for k in order if not is_steady(stretches, modes, k)]
    return any(
        is_close(modes.poles[k], modes.poles[own_modes[0]])
        or _is_multiple(modes, k, own_modes[0], HARMONIC)
        for k in own_modes[1:]
    )


def has_changing_force(
    stretches: Sequence[Stretch], origins: Sequence[int], modes: DampedModes
) -> bool:
    """Decide whether a steady oscillation of a mode's own frequency changes its size at an event.

    A force causes the same oscillation before and after an event. One that changes is a part of
    nonlinear motion, such as that towards a limit cycle. origins: index of the recording that each
    stretch comes from.
    """
    every = range(len(modes.poles))
    steady = [k for k in every if is_steady(stretches, modes, k)]
    longest = max(one.duration for one in stretches)
    for k in steady:
        if not any(_is_unresolved(modes, k, j, longest) for j in every if j not in steady):
            continue
        sizes = np.abs([each[k] for each in modes.amplitudes])
        covariances = (modes.amplitude_covariance(s, n, [k]) for n, s in enumerate(stretches))
        variances = np.array([np.diag(each)[2:].reshape(2, -1).sum(axis=0) for each in covariances])
        limits = MIN_SIGNIFICANCE * np.sqrt(variances[1:] + variances[:-1])
        is_fitted = np.isfinite(modes.noise)
        are_compared = is_fitted[1:] & is_fitted[:-1] & (np.diff(origins) == 0)[:, np.newaxis]
        if np.any((np.abs(np.diff(sizes, axis=0)) > limits) & are_compared):
            return True
    return False


def is_cycle(modes: DampedModes, order: Sequence[int]) -> bool:
    """Decide whether a fitted mode is a harmonic of the steady main mode, as in a limit cycle."""
    times = range(2, MAX_HARMONIC + 1)
    return any(_is_multiple(modes, k, order[0], n) for k in order[1:] for n in times)


def is_steady(stretches: Sequence[Stretch], modes: DampedModes, k: int) -> bool:
    """Decide whether a fitted mode neither grows nor decays."""
    longest = max(one.duration for one in stretches)
    turns = modes.poles[k].imag * longest / (2.0 * np.pi)
    change = abs(modes.poles[k].real) * longest, 2.0 * modes.growth_errors[k] * longest
    return turns > MIN_STEADY_PERIODS and max(change) < MAX_STEADY_CHANGE


def _has_opposite_growth(modes: DampedModes, own_modes: Sequence[int]) -> bool:
    """Decide whether one of two modes of similar frequency grows and the other decays."""
    main = modes.poles[own_modes[0]]
    opposed = modes.poles.real * np.sign(main.real) < -MIN_SIGNIFICANCE * modes.growth_errors
    return bool(np.any((opposed & is_close(modes.poles, main))[own_modes]))


def _grows_in_parts(modes: DampedModes, own_modes: Sequence[int], n_coordinates: int) -> bool:
    """Decide whether modes beyond one per coordinate grow at multiples of the main frequency.

    Together they follow growth to a limit cycle, or coarse samples of it.
    """
    further = modes.poles[own_modes[n_coordinates:]]
    motion = modes.poles[own_modes[:1]]
    return bool(motion[0].real > 0.0 and np.any(is_part_of(further, motion) & (further.real > 0.0)))


def _is_multiple(modes: DampedModes, k: int, main: int, times: int) -> bool:
    """Decide whether frequency and growth of a mode are a given multiple of those of another."""
    difference = modes.poles[k] - times * modes.poles[main]
    allowed_growth = MIN_SIGNIFICANCE * modes.growth_errors[k] + 0.2 * abs(modes.poles[main].real)
    allowed_frequency = MIN_SIGNIFICANCE * modes.frequency_errors[k]
    return abs(difference.real) <= allowed_growth and abs(difference.imag) <= allowed_frequency


def amplitude_gains(
    stretches: Sequence[Stretch], modes: DampedModes, main: int
) -> tuple[np.ndarray, int]:
    """Compute how far chi^2 falls if damping and frequency of a mode depend on its amplitude.

    The residual then contains exponentials of the same frequency and other decays: none by dry
    friction, twice or three times as fast by quadratic or cubic terms. Returns the fall by each of
    the three, and its degrees of freedom.
    """
    pole, gains, freedom = modes.poles[main], np.zeros(3), 0
    for index, stretch in enumerate(stretches):
        origin = np.where(modes.poles.real > 0.0, stretch.duration, 0.0)
        waves = np.exp(modes.poles * (stretch.time[:, np.newaxis] - origin))
        growth_slopes = stretch.time[:, np.newaxis] / stretch.duration * waves[:, [main]]
        columns = np.hstack([waves, growth_slopes])
        known_columns = np.hstack([columns.real, columns.imag, np.ones((len(waves), 1))])
        for c in np.flatnonzero(np.isfinite(modes.noise[index])):
            is_known = np.isfinite(modes.residuals[index][:, c])
            q, _ = np.linalg.qr(known_columns[is_known])
            residuals = modes.residuals[index][is_known, c]
            freedom += 2
            for n, growth in enumerate((0.0, 2.0 * pole.real, 3.0 * pole.real)):
                start = stretch.duration if growth > 0.0 else 0.0
                time = stretch.time[is_known] - start
                wave = np.exp(growth * time + 1j * pole.imag * stretch.time[is_known])
                further = np.column_stack([wave.real, wave.imag])
                further -= q @ (q.T @ further)
                basis, triangle = np.linalg.qr(further)
                if np.abs(np.diag(triangle)).min() < 1e-6 * np.linalg.norm(wave):
                    continue
                gains[n] += np.sum((basis.T @ residuals) ** 2) / modes.noise[index, c] ** 2
    return gains, freedom


def refit_main_oscillation(
    stretches: list[Stretch], modes: DampedModes, order: list[int]
) -> DampedModes:
    """Refit a main oscillation that is not exponential by one exponential; keep separate modes."""
    main = order[0]
    separate = [k for k in order[1:] if _is_separate(modes, k, main)]
    main_stretches = [
        replace(one, values=one.values - modes.evaluate(separate, index, one.time))
        for index, one in enumerate(stretches)
    ]
    main_modes = fit_poles(main_stretches, modes.poles[[main]])
    places = [n * len(modes.poles) + k for n in (0, 1) for k in separate]
    covariance = np.zeros((2 * len(separate) + 2,) * 2)
    rows = [0, len(separate) + 1]
    covariance[np.ix_(rows, rows)] = main_modes.covariance
    others = np.setdiff1d(np.arange(len(covariance)), rows)
    covariance[np.ix_(others, others)] = modes.covariance[np.ix_(places, places)]
    pairs = zip(main_modes.amplitudes, modes.amplitudes, strict=True)
    return replace(
        main_modes,
        poles=np.append(main_modes.poles, modes.poles[separate]),
        covariance=covariance,
        amplitudes=[np.vstack([fitted, given[separate]]) for fitted, given in pairs],
    )


def _is_separate(modes: DampedModes, k: int, main: int) -> bool:
    """Decide whether a mode is separate from a main motion that is not exponential."""
    pole = modes.poles[k]
    opposed = np.sign(pole.real) != np.sign(modes.poles[main].real)
    may_be_steady = abs(pole.real) < MIN_SIGNIFICANCE * modes.growth_errors[k]
    is_light = max(modes.growth_errors[k], abs(pole.real)) < MAX_SEPARATE_DAMPING * abs(pole)
    motion = modes.poles[[main, *np.flatnonzero(is_close(modes.poles, modes.poles[main]))]]
    is_other = not is_part_of(modes.poles[[k]], motion)[0]
    return is_light and is_other and (may_be_steady or not opposed)


def mode_energies(stretches: Sequence[Stretch], modes: DampedModes) -> np.ndarray:
    """Compute the energy of each mode, (n_modes,): the sum of its squared ratios to the noise."""
    energies = np.zeros(len(modes.poles))
    for index, stretch in enumerate(stretches):
        for k in range(len(energies)):
            ratios = modes.evaluate([k], index, stretch.time) / modes.noise[index]
            energies[k] += np.nansum(ratios**2)
    return energies
