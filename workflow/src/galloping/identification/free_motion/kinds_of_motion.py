"""Classification of the motion of recordings, before any model is searched for.

Free motion follows from its initial state: linear motion is a sum of damped sinusoids to the noise.
This is tested first, since such motion needs no random force, and a decaying one is no limit cycle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from galloping.arrays import one_thread
from galloping.identification.findings import Code, Finding
from galloping.identification.free_motion import linearity
from galloping.identification.free_motion.cleaning import remove_unexplained_samples
from galloping.identification.free_motion.damped_modes import DampedModes, Stretch, fit_poles
from galloping.identification.free_motion.envelope import (
    falls_or_rises,
    in_strongest_channel,
    running_amplitude,
    strongest_channel,
)
from galloping.identification.free_motion.events import MotionBetweenEvents, find_events
from galloping.identification.free_motion.mode_search import (
    fit_modes,
    is_close,
    unexplained_power_share,
)
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.preparation.channels import Channels
from galloping.identification.preparation.smoothing import DRIFT_DEGREE, sampled_rates
from galloping.model.intervals import MIN_SIGNIFICANCE
from galloping.model.polynomial import velocity_pairs
from galloping.recording.samples import Recording

MAX_EVENT_SHARE = 0.4  # largest share of a channel's power that events explain beyond modes
WINDOWS = 24  # number of windows of a running amplitude in a stretch; each lasts a period or more


@dataclass(frozen=True)
class FreeMotion:
    """Recordings of a motion that follows from its initial state, apart from a steady force.

    recordings: stretches of free motion between events, without outliers and samples during an
    event. stretches: their channels. is_linear: whether damped sinusoids follow the motion to the
    noise. modes: resolved modes, fitted to the recordings. own_modes: indices of the system's ones,
    that with most energy first. steady_modes: indices of steady oscillations. linear_motion: the
    same motion, classified as a linear one with several modes, if these modes may also be parts of
    a single nonlinear oscillation; else None.
    """

    recordings: list[Recording]
    stretches: list[Stretch]
    is_linear: bool
    channels: Channels
    modes: DampedModes
    own_modes: tuple[int, ...]
    steady_modes: tuple[int, ...]
    findings: tuple[Finding, ...]
    linear_motion: "FreeMotion | None" = None

    @property
    def decays(self) -> bool:
        """Whether the mode with most energy decays."""
        return bool(self.modes.poles[self.own_modes[0]].real < 0.0)

    @property
    def further_modes(self) -> tuple[int, ...]:
        """Indices of the modes beyond one for each coordinate, including steady oscillations."""
        return (*self.own_modes[len(self.channels.pairs) :], *self.steady_modes)


@one_thread
def classify_motion(recordings: Sequence[Recording]) -> FreeMotion | None:
    """Find the modes of recorded motion if it is free, rather than driven or possibly sustained.

    recordings: without rests, see `rest.moving_recordings`. Returns None if inputs drive the
    motion, if random forces or the system itself may sustain it, or if its states are exact, or are
    not displacements and velocities.
    """
    recordings = list(recordings)
    if recordings[0].inputs or any(one.exact for one in recordings):
        return None
    channels = Channels.from_recordings(recordings)
    paired = {k for pair in velocity_pairs(recordings[0].states).items() for k in pair}
    if not paired.issuperset((*channels.values, *channels.rates)) or not channels.names:
        return None
    motion = attempt(_free_motion, recordings, channels)
    return None if isinstance(motion, NoModel) else motion


def _free_motion(recordings: list[Recording], channels: Channels) -> FreeMotion | None:
    stretches = [_make_stretch(one, channels) for one in recordings]
    may_continue = partial(_main_amplitude_changes, stretches)
    modes, is_noise = fit_modes(stretches, may_continue)
    if modes is not None and (cleaned := remove_unexplained_samples(stretches, modes)) is not None:
        stretches = cleaned
        modes, is_noise = fit_modes(stretches, may_continue)
    if modes is None:
        return None
    order = linearity.resolved_modes(stretches, modes, is_noise)
    n_coordinates = len(channels.pairs)
    is_linear = is_noise and linearity.has_linear_modes(stretches, modes, order, n_coordinates)
    findings: list[Finding] = []
    linear_motion: FreeMotion | None = None
    if is_linear and linearity.may_be_single(stretches, modes, order):
        fit = stretches, modes, order
        linear_motion = _classify_modes(recordings, channels, *fit, True, findings)
        is_linear = False
    if not is_linear:
        floor = modes.misfit
        modes = linearity.refit_main_oscillation(stretches, modes, order)
        events = _find_linear_events(stretches, modes, floor, n_coordinates)
        if events is not None and not (is_noise and floor < _penalised_misfit(stretches, events)):
            recordings, findings = _split_at_events(recordings, events, channels)
            stretches, modes, is_linear = events.stretches, events.modes, True
        order = np.argsort(-linearity.mode_energies(stretches, modes), kind="stable").tolist()
    motion = _classify_modes(recordings, channels, stretches, modes, order, is_linear, findings)
    if motion is None or is_linear:
        return motion or linear_motion
    return replace(motion, linear_motion=linear_motion)


def _find_linear_events(
    stretches: list[Stretch], modes: DampedModes, floor: float, n_coordinates: int
) -> MotionBetweenEvents | None:
    """Find events between which motion is linear, None if there are none, or too many.

    modes: the main one first. floor: as of `find_events`.
    """
    main = fit_poles(stretches, modes.poles[:1])
    for start in (modes, main) if len(modes.poles) > 1 else (modes,):
        if unexplained_power_share(stretches, start) > MAX_EVENT_SHARE:
            continue
        if (events := find_events(stretches, start, floor)) is not None:
            order = linearity.resolved_modes(events.stretches, events.modes, is_noise=True)
            fit = events.stretches, events.modes, order
            if (
                linearity.has_linear_modes(*fit, n_coordinates)
                and not linearity.may_be_single(*fit)
                and not linearity.has_changing_force(events.stretches, events.origins, events.modes)
                and not _is_explained_by_amplitude(stretches, start, events)
            ):
                return events
    return None


def _is_explained_by_amplitude(
    stretches: list[Stretch], modes: DampedModes, events: MotionBetweenEvents
) -> bool:
    """Decide whether a nonlinear main mode explains the motion as well as events do.

    modes: fitted without events, the main one first.
    """
    gains, freedom = linearity.amplitude_gains(stretches, modes, 0)
    samples = sum(np.count_nonzero(np.isfinite(one.values)) for one in stretches)
    misfit = modes.misfit - gains.max() + freedom * np.log(samples)
    return misfit <= _penalised_misfit(stretches, events)


def _classify_modes(
    recordings: list[Recording],
    channels: Channels,
    stretches: list[Stretch],
    modes: DampedModes,
    order: list[int],
    is_linear: bool,
    findings: list[Finding],
) -> FreeMotion | None:
    """Make the motion of modes in the order of their energy, None if something may sustain it."""
    steady = [k for k in order if linearity.is_steady(stretches, modes, k)]
    own_modes = [k for k in order if k not in steady]
    if not own_modes or (
        order[0] in steady and (not is_linear or linearity.is_cycle(modes, order))
    ):
        return None
    if steady and is_linear:
        is_steady = np.isin(np.arange(len(modes.poles)), steady)
        poles = np.where(is_steady, 1j * modes.poles.imag, modes.poles)
        modes = fit_poles(stretches, poles, is_steady)
    if is_linear:
        if (
            abs(modes.poles[own_modes[0]].real)
            < MIN_SIGNIFICANCE * modes.growth_errors[own_modes[0]]
        ):
            return None
        pairs = zip(recordings, stretches, strict=True)
        recordings = [_with_samples(one, stretch, channels) for one, stretch in pairs]
    elif not falls_or_rises(_running_amplitudes(stretches, modes, own_modes[:1])):
        return None  # otherwise, samples that linear motion does not explain are no faults
    return FreeMotion(
        recordings, stretches, is_linear, channels, modes, tuple(own_modes), tuple(steady),
        tuple(findings),
    )  # fmt: skip


def _make_stretch(recording: Recording, channels: Channels) -> Stretch:
    """Extract the channels of a recording; rates with an unknown offset have a slow drift."""
    values = recording.values.T[list(channels.values)]
    rates = sampled_rates(recording).T[list(channels.rates)]
    offsets = recording.unknown_offsets
    degrees = [DRIFT_DEGREE if offsets is not None and offsets[i] else 0 for i in channels.rates]
    time = recording.time - recording.time[0]
    return Stretch(time, np.vstack([values, rates]).T, (*[0] * len(values), *degrees))


def _with_samples(recording: Recording, stretch: Stretch, channels: Channels) -> Recording:
    """Replace the samples of a recording by those of a stretch, some of which are left out."""
    values, count = recording.values.copy(), len(channels.values)
    values[:, list(channels.values)] = stretch.values[:, :count]
    if recording.rates is None:
        return replace(recording, values=values)
    rates = recording.rates.copy()
    rates[:, list(channels.rates)] = stretch.values[:, count:]
    return replace(recording, values=values, rates=rates)


def without_further_modes(motion: FreeMotion) -> list[Recording]:
    """Subtract the modes in excess of one per coordinate from recordings of free motion.

    Displacements of the equilibrium by steps of a force are removed too, with respect to the first
    recording in which a channel has an offset.
    """
    remaining, offsets = [], motion.modes.offsets
    first = np.argmax(np.isfinite(offsets), axis=0)
    origin = np.take_along_axis(offsets, first[np.newaxis], axis=0)[0]
    pairs = zip(motion.recordings, motion.stretches, strict=True)
    for index, (recording, stretch) in enumerate(pairs):
        removed = motion.modes.evaluate(motion.further_modes, index, stretch.time)
        if any(each.code == Code.FORCE_STEPPED for each in motion.findings):
            removed = removed + np.nan_to_num(offsets[index] - origin)
        rest = replace(stretch, values=stretch.values - removed)
        remaining.append(_with_samples(recording, rest, motion.channels))
    return remaining


def _main_amplitude_changes(stretches: list[Stretch], modes: DampedModes) -> bool:
    """Decide whether the modes near the first one's frequency decay, or grow, throughout."""
    main = np.flatnonzero(is_close(modes.poles, modes.poles[0])).tolist()
    return falls_or_rises(_running_amplitudes(stretches, modes, main))


def _running_amplitudes(
    stretches: list[Stretch], modes: DampedModes, places: Sequence[int]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Compute amplitudes of modes of about the same frequency in windows of each stretch.

    Returns values and standard errors, as for `falls_or_rises`.
    """
    amplitudes, omega = [], modes.poles[places[0]].imag
    longest = max(one.duration for one in stretches)
    for index, stretch in enumerate(stretches):
        if 2.0 * stretch.duration < longest or np.isnan(modes.noise[index]).all():
            continue  # a few periods follow any trend
        _, time, values = in_strongest_channel(stretch, modes, index, places)
        length = max(2.0 * np.pi / omega, stretch.duration / WINDOWS)
        amplitudes.append(running_amplitude(time, values, omega, length)[1:])
    return amplitudes


def _penalised_misfit(stretches: list[Stretch], events: MotionBetweenEvents) -> float:
    """Compute the misfit of a fit with events, plus the penalty of their parameters.

    Each event adds its time and, for each channel, the amplitudes of the modes and an offset.
    """
    n_channels = stretches[0].values.shape[1]
    of_event = 1 + n_channels * (2 * len(events.modes.poles) + 1)
    added = (len(events.stretches) - len(stretches)) * of_event
    samples = sum(np.count_nonzero(np.isfinite(one.values)) for one in stretches)
    return events.modes.misfit + added * np.log(samples)


def _split_at_events(
    recordings: list[Recording], events: MotionBetweenEvents, channels: Channels
) -> tuple[list[Recording], list[Finding]]:
    """Split recordings at events, and make a finding on each event."""
    parts, findings = [], []
    begins = dict.fromkeys(events.origins, 0)
    for k, (part, origin) in enumerate(zip(events.stretches, events.origins, strict=True)):
        begin, recording = begins[origin], recordings[origin]
        if begin:
            time = recording.time[begin]
            elapsed = time - recording.time[begin - len(events.stretches[k - 1].time)]
            finding = _describe_event(events.modes, k, elapsed, float(time), channels)
            findings.append(replace(finding, recording=origin))
        parts.append(recording[begin : begin + len(part.time)])
        begins[origin] = begin + len(part.time)
    return parts, findings


def _describe_event(
    modes: DampedModes, k: int, elapsed: float, time: float, channels: Channels
) -> Finding:
    """Describe the event between stretches k - 1 and k, `elapsed` s after the first begins."""
    mode = int(np.argmax(np.abs(modes.standardised_amplitudes(k)).max(axis=1)))
    forecast = modes.amplitudes[k - 1] * np.exp(modes.poles * elapsed)[:, np.newaxis]
    amplitudes = modes.amplitudes[k]
    channel = strongest_channel(modes, k, mode)
    offset = modes.offsets[k] - modes.offsets[k - 1]
    error = np.hypot(modes.offset_errors[k], modes.offset_errors[k - 1])
    with np.errstate(invalid="ignore"):
        stepped = np.flatnonzero(np.abs(offset) > MIN_SIGNIFICANCE * error)
    if stepped.size:
        c = int(stepped[np.argmax(np.abs(offset[stepped]) / error[stepped])])
        change = float(offset[c])
        return Finding.of(Code.FORCE_STEPPED, channels.names[c], time_s=time, change=change)
    share = abs(amplitudes[mode, channel] - forecast[mode, channel]) / abs(forecast[mode, channel])
    return Finding.of(Code.KNOCKED, channels.names[channel], time_s=time, share=float(share))
