"""Summary of an identified model: properties of its system with intervals, forecasts, text."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import (
    TIME_ROUNDING,
    Immutable,
    as_finite,
    as_increasing,
    first_from,
    one_thread,
    round_down,
    round_up,
)
from galloping.behaviour import dynamics as of_line
from galloping.behaviour import forecast as ahead
from galloping.behaviour.dynamics import Dynamics, Surroundings
from galloping.behaviour.extrapolation import with_extent, with_extrapolation
from galloping.behaviour.following import Following, Sensed, check_recordings, without_outliers
from galloping.behaviour.forecast import Forecast, ScoredForecast, check_followed, with_factors
from galloping.behaviour.objections import Identify, with_objections
from galloping.identification.findings import Finding
from galloping.identification.free_motion.answer import without_omissions
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import segments_with_inputs
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.preparation.rate_channels import divide_by_scales
from galloping.identification.preparation.smoothing import deviations_of
from galloping.identification.random_forces import forced_motion as in_random_forces
from galloping.identification.random_forces.low_pass import apply_model_filter
from galloping.identification.work import limit_work
from galloping.inspection.excerpts import identify_excerpts
from galloping.inspection.quality import MIN_PERIODS, dominant_frequencies, sampled_time
from galloping.progress_reports import part, passing
from galloping.readers.units import EMPTY_MAPPING
from galloping.recording.samples import Input, Recording, typical_inputs
from galloping.summary.further_recording import Advice, advise
from galloping.summary.numbers import compute_numbers
from galloping.summary.wording import render_summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHODS: Mapping[str, Callable[..., IdentifiedModel]] = {
    "maximum_likelihood": maximum_likelihood,
    "weak_gls": weak_gls,
}
# end of a recording that is held out to test the forecast: largest share, and periods
HELD_OUT_SHARE, MAX_HELD_OUT_PERIODS = 0.1, 30
MAX_FORECAST_SAMPLES = 5000  # samples of a forecast
# periods of the motion that determine the initial state of a forecast; length of a scored stretch
START_PERIODS = 6
MOTION_POINTS = 600  # points of a plotted motion


class StillError(ValueError):
    """Error raised if nothing moves in the part of a recording that is held out."""


@dataclass(frozen=True, eq=False, repr=False)
class Summary(Immutable):
    """Properties and forecasts of an identified model, and how far they can be trusted.

    Printed, it is the text of `summary.md`. An attribute is None or empty if the model and the
    recordings do not determine it.

    Attributes
    ----------
    found : IdentifiedModel
        The model. Its status is lowered if the recordings contradict it, and its forecasts have
        the accuracy that the held-out end showed.
    recordings : tuple of Recording
    dynamics : Dynamics or None
        Equilibrium, natural frequencies, damping and limit cycle.
    held_out : ScoredForecast or None
        Forecast of the end of the last recording by a model identified without it. If that end is
        too short, it is the end of the longest recording.
    untried : str
        Why nothing was held out.
    is_still : bool
        Whether nothing was held out because the end does not move.
    forecast : Forecast or None
        Forecast of what follows the last recording.
    motions : tuple of (ndarray, ndarray)
        Motion of the model in the first, middle and last part of the last recording: times (n,), s,
        and channels (n, n_sensed).
    advice : Advice or None
        The further recording that would help most.
    """

    found: IdentifiedModel
    recordings: tuple[Recording, ...]
    dynamics: Dynamics | None = None
    held_out: ScoredForecast | None = None
    untried: str = ""
    is_still: bool = False
    forecast: Forecast | None = None
    motions: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...] = ()
    advice: Advice | None = None

    @property
    def forecasts(self) -> list[Forecast]:
        """Forecasts of the held-out end of a recording and of the time after the last one.

        The band over the held-out end has the width that this end needed. A useless forecast of
        that end is omitted.
        """
        trial = self.held_out
        held_out = [trial.forecast.widened(trial.factors)] if trial and trial.useful else []
        return [*held_out, *([self.forecast] if self.forecast else [])]

    def __str__(self) -> str:
        return render_summary(self, compute_numbers(self))

    _repr_markdown_ = __str__  # for notebooks

    def __repr__(self) -> str:
        return f"Summary of {self.found!r}"

    def draw_fit(self) -> "Figure":
        """Plot the model's motion and the samples, or their spectra if random forces act.

        Needs matplotlib.
        """
        from galloping.summary.drawing import draw_fit, draw_spectra

        if self.found.is_forced:
            return draw_spectra(self.found, self.recordings[-1])
        return draw_fit(self.recordings[-1], self.motions)

    def draw_forecast(self) -> "Figure":
        """Plot the forecasts of the held-out end and after the recording, with 90 % bands."""
        from galloping.summary.drawing import draw_forecast

        trial, last_recording = self.held_out, [self.recordings[-1]] * (self.forecast is not None)
        held_out_recording = [self.recordings[trial.index]] if trial and trial.useful else []
        length = np.ptp(self.motions[0][0]) if self.motions else 0.0
        return draw_forecast([*held_out_recording, *last_recording], self.forecasts, length)


@one_thread
def summarise(
    found: IdentifiedModel,
    recordings: Recording | Sequence[Recording],
    *,
    method: str = "maximum_likelihood",
    seed: int = 0,
    **options: object,
) -> Summary:
    """Compute the properties and forecasts of an identified model, with text and figures.

    To test forecasts, the end of the last recording is held out and forecast by a model of the
    rest.

    Parameters
    ----------
    found : IdentifiedModel
    recordings : Recording or sequence of Recording
        Recordings from which the model was identified.
    method : {"maximum_likelihood", "weak_gls"}
        The method that found the model.
    seed : int
        Seed of the random numbers for the intervals.
    **options : object
        Further keywords that the method was called with, such as `prior`.

    Returns
    -------
    Summary

    Raises
    ------
    ValueError
        If an argument has another form.
    """
    if method not in METHODS:
        raise ValueError(f"method: {method!r}; must be one of {', '.join(METHODS)}")
    recording_list = _check_recordings(found, recordings)

    def identify(others: Sequence[Recording]) -> IdentifiedModel:
        known_states = tuple(found.model.states[i] for i in found.known)
        terms = found.model.terms
        return identify_excerpts(
            METHODS[method], list(others), terms, found.model, known_states, **options
        )

    names = [f"recording {number}" for number in range(1, len(recording_list) + 1)]
    with limit_work(recording_list):
        return summarise_with(found, recording_list, identify, seed, names=names)


@one_thread
def summarise_with(
    found: IdentifiedModel,
    recordings: Sequence[Recording],
    identify: Identify,
    seed: int,
    *,
    names: Sequence[str],
    faults: Sequence[Finding] = (),
    are_one: bool = False,
) -> Summary:
    """Summarise an identified model, given a function that repeats its identification.

    identify: the method of the model. names, faults, are_one: as of `with_objections`. Raises
    ValueError if there is a model and no channel oscillates.
    """
    recordings = _select_used_parts(found, recordings)
    period, last = longest_period(recordings), recordings[-1]
    untried, is_still = "", False
    with part("compare the recordings", until=0.3):
        found = with_objections(found, recordings, names, period, identify, faults, are_one)
    if found.status == "refused":
        return Summary(found, tuple(recordings))
    window = START_PERIODS * _check_period(period)
    with part("hold out the end", until=0.7):
        try:
            held_out = hold_out(recordings, period, identify, np.random.default_rng(seed))
            found = with_factors(found, held_out)
        except ValueError as error:
            held_out, untried, is_still = None, str(error), isinstance(error, StillError)
    with part("forecast", until=0.8):
        try:
            time, rng = _make_times_after(last, window), np.random.default_rng(seed)
            predicted = ahead.forecast(found, last, time, window, rng)
        except ValueError:
            predicted = None
    with part("follow the motion", until=1.0):
        found = with_extrapolation(with_extent(found, recordings), recordings)
        return Summary(
            found,
            tuple(recordings),
            _compute_dynamics(found, recordings, seed),
            held_out,
            untried,
            is_still,
            predicted,
            tuple(simulate_beside(found, last, window)),
            advise(found, last, period),
        )


@one_thread
def dynamics(
    found: IdentifiedModel, recordings: Recording | Sequence[Recording], *, seed: int = 0
) -> Dynamics | None:
    """Compute a model's equilibrium, frequencies, damping and limit cycle, with 95 % intervals.

    Inputs of the model are constant, at their means.

    Parameters
    ----------
    found : IdentifiedModel
    recordings : Recording or sequence of Recording
        Recordings from which the model was identified.
    seed : int
        Seed of the random numbers for the intervals.

    Returns
    -------
    Dynamics or None
        None if there is no model, or no state is the velocity of another state.

    Raises
    ------
    ValueError
        If an argument has another form.
    """
    parts = _select_used_parts(found, recordings)
    if not len(found.extrapolation_shift):
        found = with_extrapolation(found, parts)
    return _compute_dynamics(found, parts, seed)


def _compute_dynamics(
    identified: IdentifiedModel, parts: Sequence[Recording], seed: int
) -> Dynamics | None:
    """Compute the dynamics of a model from the parts of recordings that it was identified from."""
    inputs = typical_inputs(identified.model.inputs, parts)
    surroundings, rng = Surroundings.of(parts), np.random.default_rng(seed)
    properties = of_line.dynamics(
        identified.at(inputs) if inputs else identified, surroundings, rng
    )
    return replace(properties, at=inputs) if properties else None


@one_thread
def forecast(
    found: IdentifiedModel,
    recording: Recording,
    time: ArrayLike | None = None,
    *,
    window: float | None = None,
    inputs: Mapping[str, Input | float] = EMPTY_MAPPING,
    seed: int = 0,
) -> Forecast:
    """Forecast the samples after the end of a recording, as a median and a 90 % band.

    If the model is `found` of a `Summary`, the band has the width that the held-out end needed.

    Parameters
    ----------
    found : IdentifiedModel
    recording : Recording
        It may be newer than the recordings of the model; only its end is used.
    time : (n,) array, optional
        Times after its last sample, s, on its clock; by default as long as `window`.
    window : float, optional
        Length of the end from which the forecast starts, s; by default six periods of the motion.
    inputs : mapping of str to Input or float
        Inputs after the recording, measured or constant, unless the recording contains them.
    seed : int
        Seed of the random numbers for the band.

    Returns
    -------
    Forecast

    Raises
    ------
    ValueError
        If there is no model, it does not follow the recording, an input is unknown, most models
        drawn from its covariance diverge, or an argument has another form.
    """
    *_, recording = _select_used_parts(found, recording)
    if window is None:
        window = START_PERIODS * _check_period(longest_period([recording]))
    elif (window := float(as_finite("window", window, ()))) <= 0.0:
        raise ValueError(f"window: {window:g} s; must be > 0")
    end = recording.time[-1]
    times = _make_times_after(recording, window) if time is None else as_increasing("time", time)
    if times[0] <= end:
        raise ValueError(f"time: begins at {times[0]:g} s; the recording ends at {end:g} s")
    if found.status != "refused":
        check_followed(found, recording, window)
    return ahead.forecast(found, recording, times, window, np.random.default_rng(seed), inputs)


def _select_used_parts(identified: IdentifiedModel, recordings: object) -> list[Recording]:
    """Return the parts of recordings that a model was identified from, without filtered motion.

    Channels of unknown scale are divided by the scale that was found.
    """
    recording_list = _check_recordings(identified, recordings)
    if identified.model.inputs:
        recording_list = segments_with_inputs(recording_list, identified.model.inputs)
    scaled = divide_by_scales(recording_list, identified.diagnostics)
    return apply_model_filter(identified, without_omissions(identified, scaled))


def _check_recordings(found: object, recordings: object) -> list[Recording]:
    if not isinstance(found, IdentifiedModel):
        raise ValueError(
            f"found: a {type(found).__name__}; must be an IdentifiedModel, such as "
            "`maximum_likelihood` returns"
        )
    return check_recordings(found.model, recordings)


def longest_period(recordings: Sequence[Recording]) -> float:
    """Return the longest period (s) among the dominant oscillations of the recorded channels.

    It is the first of each channel of which the recording has MIN_PERIODS periods: slower ones are
    drifts of the mean, which accompany a growing motion. Infinite if no channel oscillates.
    """
    frequencies = []
    for recording in recordings:
        least = MIN_PERIODS / sampled_time(recording.time, recording.step) * (1.0 - TIME_ROUNDING)
        for channel in Sensed.by(recording).samples(recording).T:
            is_finite = np.isfinite(channel)
            if np.count_nonzero(is_finite) > 1:
                samples = recording.time[is_finite], channel[is_finite]
                dominant = dominant_frequencies(*samples, recording.step)
                frequencies += [f for f in dominant if f >= least][:1] or list(dominant[:1])
    return 1.0 / min(frequencies) if frequencies else np.inf


def _check_period(period: float) -> float:
    if np.isinf(period):
        raise ValueError("recordings: no channel oscillates: there is no motion to identify")
    return period


def _make_times_after(recording: Recording, length: float) -> NDArray[np.float64]:
    """Make times, s, of samples after a recording, at its own step, for `length` s."""
    step = max(recording.step, length / MAX_FORECAST_SAMPLES)
    return recording.time[-1] + step * np.arange(1, round_up(length / step))


def hold_out(
    recordings: Sequence[Recording], period: float, identify: Identify, rng: np.random.Generator
) -> ScoredForecast:
    """Identify a model without the end of the last recording, and forecast that end.

    It is that of the longest one, if the part of the last would be shorter than `period`, s, the
    longest of the motion. Raises ValueError if the shortened recordings give no model, or the model
    no forecast; StillError if nothing moves in that part.
    """
    index = len(recordings) - 1
    if HELD_OUT_SHARE * np.ptp(recordings[index].time) < period:
        index = int(np.argmax([np.ptp(one.time) for one in recordings]))
    last, others = recordings[index], [*recordings[:index], *recordings[index + 1 :]]
    length = min(HELD_OUT_SHARE * np.ptp(last.time), MAX_HELD_OUT_PERIODS * period)
    cut = int(first_from(last.time, last.time[-1] - length))
    samples = Sensed.by(last).samples(without_outliers(last))
    if np.all(deviations_of(samples[cut:]) <= 1e-9 * deviations_of(samples)):  # rounding
        raise StillError(f"no motion in the last {length:.3g} s, which were to be forecast")
    forecast_rows = slice(cut, None, 1 + (len(last.time) - cut) // MAX_FORECAST_SAMPLES)
    identified = identify([*others, last[:cut]])
    predicted = ahead.forecast(
        identified, last[:cut], last.time[forecast_rows], START_PERIODS * period, rng
    )
    noise = Following(identified, last[:cut]).sigma
    trial = ahead.score_forecast(predicted, samples[forecast_rows], deviations_of(samples), noise)
    return replace(trial, index=index - len(recordings))


def simulate_beside(
    identified: IdentifiedModel, recording: Recording, length: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Simulate a model over the beginning, middle and end of a recording, from fitted states.

    Returns times (n,) and channels (n, n_sensed) of each stretch of `length` s through which the
    model does not diverge; it starts from the state that follows the samples best.
    """
    time, model = recording.time, identified.model
    follow = Following(identified, without_outliers(recording))
    forced = identified.is_forced
    filtered = in_random_forces.filter_states(identified, recording) if forced else None
    motions = []
    for share in (0.0, 0.5, 1.0):
        passing("beside the samples")
        begin = time[0] + share * max(np.ptp(time) - length, 0.0)
        rows = slice(*first_from(time, (begin, begin + length)))
        times = time[rows]
        if len(times) < 2:
            continue
        if filtered is not None:
            motions.append((times, follow.to_channels(model, filtered[rows], times)))
        elif (start := follow.fit_start(rows)) is not None:
            smooth = np.linspace(times[0], times[-1], MOTION_POINTS)
            motions.append((smooth, follow.motion(model, start, smooth)))
    return motions


def score_motion(
    identified: IdentifiedModel, recordings: Sequence[Recording]
) -> NDArray[np.float64]:
    """Compute R2 of a model's simulated motion against the samples of each recorded channel.

    identified: a model without random forces. recordings: each is cut into equal stretches of about
    START_PERIODS periods, in each of which the model starts from the state that follows the samples
    best. Returns (n_channels,) of the measured channels. A stretch in which the model diverges
    counts as if the mean of its recording were the motion. Raises ValueError if random forces move
    the model.
    """
    if identified.is_forced:
        raise ValueError("score: random forces move the model, which has no motion of its own")
    squares: dict[str, list[NDArray[np.float64]]] = {}
    period = longest_period(recordings)
    for recording in recordings:
        follow, time = Following(identified, without_outliers(recording)), recording.time
        samples = follow.samples
        is_measured = np.isfinite(samples).any(axis=0)
        mean = np.nanmean(samples[:, is_measured], axis=0)
        parts = max(round_down(np.ptp(time) / (START_PERIODS * period)), 1)
        edges = first_from(time, np.linspace(time[0], time[-1], parts + 1))
        residual = samples[:, is_measured] - mean
        whole = residual**2
        for begin, end in pairwise((*edges[:-1], len(time))):
            rows = slice(begin, end)
            if np.isfinite(residual[rows]).any() and (start := follow.fit_start(rows)) is not None:
                motion = follow.motion(identified.model, start, time[rows])[:, is_measured]
                if np.isfinite(motion).all():
                    residual[rows] = samples[rows][:, is_measured] - motion
        sums = np.nansum([residual**2, whole], axis=1)
        for name, pair in zip(np.array(follow.sensed.names)[is_measured], sums.T, strict=True):
            squares.setdefault(str(name), []).append(pair)
    if not squares:
        raise ValueError("score: the recordings have no samples")
    missed, whole = np.array([np.sum(pairs, axis=0) for pairs in squares.values()]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        return 1.0 - missed / whole
