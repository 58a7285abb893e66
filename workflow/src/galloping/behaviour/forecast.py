"""Forecasts of a recorded motion with intervals, and scores of such forecasts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from galloping.arrays import TIME_ROUNDING, Immutable, first_from, round_down
from galloping.behaviour.following import Following, Sensed, without_outliers
from galloping.identification.drawn_models import draw_models
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.preparation.smoothing import deviations_of
from galloping.identification.random_forces import forced_motion as in_random_forces
from galloping.model.intervals import QUANTILES_90
from galloping.model.polynomial import PolynomialModel
from galloping.progress_reports import passing
from galloping.readers.units import EMPTY_MAPPING
from galloping.recording.samples import MAX_INTERPOLATED_STEPS, Input, Recording

if TYPE_CHECKING:
    from pandas import DataFrame

# Number of drawn models and starts: the ends of a 90 % band scatter by a tenth of its width.
FORECAST_DRAWS = 100
MAX_MISFIT = 1.3  # largest chi^2 per sample of a model that follows the recording
WINDOW_SHARES = (1.0, 0.5, 0.25)  # shares of the window, tried in turn if motions soon diverge
MIN_FOLLOWING_SHARE = 0.9  # smallest share of the draws that follow the recording
MIN_WINDOW_SAMPLES = 5  # smallest mean number of samples of a channel in a checked window
# Earlier forecasts, which show the errors of an approximate model.
N_ORIGINS = 8  # number of earlier forecasts, and of windows by which a model is checked
PARTS_PER_WINDOW = 4  # number of parts of a window over which errors are averaged
HORIZON_WINDOWS = 5  # duration of an earlier forecast, and of the checked end, in windows
WIDENING_PREFIX = "forecast_widened_"  # prefix of the diagnostic of a channel's factor
NO_FORECAST_REASON = "that of what was held out of its recordings was worse than their mean"
COVERAGE_QUANTILE = 0.01  # probability that a correct band contains a smaller share of the samples
MAX_SAMPLES = 4000  # largest number of samples in a fit of an initial state: more add little
MAX_NOISE_EXCESS = 3.0  # largest excess of a mean square over that of noise, in standard errors


@dataclass(frozen=True, eq=False, repr=False)
class Forecast(Immutable):
    """Forecast of all measured channels: median and 90 % band at each time.

    Attributes
    ----------
    names : tuple of str
        Names of the n_sensed channels, the states first.
    time : (n,) array
        Times, s.
    median, low, high : (n, n_sensed) arrays
        Median and ends of the 90 % band of the samples.
    chance : (n_sensed,) array
        Share of samples inside the band that a correct band falls below once in a hundred times.
    """

    names: tuple[str, ...]
    time: NDArray[np.float64]
    median: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    chance: NDArray[np.float64]

    def __repr__(self) -> str:
        first, last = self.time[0], self.time[-1]
        return f"Forecast of {', '.join(self.names)} from {first:.6g} to {last:.6g} s"

    def channel_columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the median and the ends of the 90 % band of each channel as named arrays (n,)."""
        parts = {"": self.median, "_low": self.low, "_high": self.high}
        return {
            f"{name}{end}": values[:, k]
            for k, name in enumerate(self.names)
            for end, values in parts.items()
        }

    def to_frame(self) -> "DataFrame":
        """Return the forecast as a pandas DataFrame, with a row for each time.

        Returns
        -------
        DataFrame
            A row for each time, which is the index `t` in s. Of each channel `X` the columns `X`,
            the median, and `X_low` and `X_high`, the ends of its 90 % band.
        """
        import pandas as pd  # an extra, and slow to import

        return pd.DataFrame(self.channel_columns(), pd.Index(self.time, name="t"))

    def widened(self, factors: NDArray[np.float64]) -> "Forecast":
        """Return the forecast with the band of each channel widened about the median.

        factors: (n_sensed,), by which the bands are widened.
        """
        low, high = (self.median + factors * (end - self.median) for end in (self.low, self.high))
        return replace(self, low=low, high=high)


def forecast(
    identified: IdentifiedModel,
    recording: Recording,
    time: np.ndarray,
    window: float,
    rng: np.random.Generator,
    inputs: Mapping[str, Input | float] = EMPTY_MAPPING,
) -> Forecast:
    """Forecast the samples after a recording by a model started from the last `window` seconds.

    Outliers of the recording are left out. Each of 100 draws has coefficients drawn with their
    covariance, and the initial state that fits the samples of the window, with noise added again.
    The band includes the noise of a sample. The band of an approximate model is as wide as the
    errors of its forecasts from earlier times of the recording. If the draws of an exact model do
    not follow the samples, since their motions soon diverge from each other, the window is halved.
    The band at an instant does not depend on later instants. A model under random forces continues
    from the state of its filter, with newly drawn forces. Bands are widened by the factors that
    held-out samples required. Raises ValueError if there is no model, if most draws do not follow
    the window or diverge, or if the forecast of held-out samples was useless.
    """
    if identified.status == "refused":
        raise ValueError(f"there is no model to forecast with: {identified.reason}")
    sensed = Sensed.by(recording)
    keys = [f"{WIDENING_PREFIX}{name}" for name in sensed.names]
    factors = np.array([identified.diagnostics.get(key, 1.0) for key in keys])
    if np.isinf(factors).any():
        raise ValueError(f"the model gives no forecast: {NO_FORECAST_REASON}")
    recording = _extend_inputs(identified.model, without_outliers(recording), time, inputs)
    follow = Following(identified, recording)
    sigma = follow.sigma
    if identified.is_forced:
        models = draw_models(identified, rng, FORECAST_DRAWS)
        states = in_random_forces.simulate_motions(identified, models, recording, time, rng)
        pairs = zip(models, states, strict=True)
        motions = np.array([follow.to_channels(*pair, time) for pair in pairs])
        errors = in_random_forces.add_force_noise(identified, recording, sensed.rates, sigma)
    elif identified.status == "approximate":
        motions = _draw_motions(follow, time, window, np.inf, rng)
        errors = _compute_past_errors(follow, time - recording.time[-1], window)
    else:
        for share in WINDOW_SHARES:
            motions = _draw_motions(follow, time, share * window, MAX_MISFIT, rng)
            if len(motions) > MIN_FOLLOWING_SHARE * FORECAST_DRAWS:
                break
        errors = np.zeros_like(sigma)
    if len(motions) < FORECAST_DRAWS // 2:
        raise ValueError(
            f"{FORECAST_DRAWS - len(motions)} of {FORECAST_DRAWS} draws of the model do not follow "
            f"the last {min(window, np.ptp(recording.time)):.3g} s of the recording"
        )
    is_bounded = np.isfinite(motions).all(axis=(1, 2))
    if is_bounded.sum() < FORECAST_DRAWS // 2:
        diverged = FORECAST_DRAWS - is_bounded.sum()
        raise ValueError(f"{diverged} of {FORECAST_DRAWS} draws of the model diverge")
    noise = rng.standard_normal((len(time), *motions.shape[::2])).transpose(1, 0, 2)
    samples = motions + np.maximum(sigma, errors) * noise
    low, high = _compute_quantiles(samples, QUANTILES_90)
    bounded = samples[is_bounded]
    coverage = np.mean((bounded >= low) & (bounded <= high), axis=1)
    chance = np.quantile(coverage, COVERAGE_QUANTILE, axis=0)
    ahead = Forecast(sensed.names, time, _compute_quantiles(motions, (0.5,))[0], low, high, chance)
    return ahead.widened(factors) if factors.max() > 1.0 else ahead


@dataclass(frozen=True, eq=False)
class ScoredForecast(Immutable):
    """Forecast of samples that the identification did not use, with scores of its accuracy.

    forecast: with its band as it was computed. skill: (n_sensed,) R2 of the median. missed:
    (n_sensed,) root mean square error of the median, over the deviation of the whole recording.
    held: (n_sensed,) share of the samples inside the band. is_noise: (n_sensed,) boolean, whether
    the samples are noise alone. factors: (n_sensed,) by which the band must be widened to contain
    90 % of the samples: 1 if no fewer are inside than chance allows, infinite if the forecast is
    worse than the mean of the samples and so useless. Scores of channels without samples are NaN,
    their factors 1. index: of the recording whose end is forecast, -1 for the last.
    """

    forecast: Forecast
    skill: NDArray[np.float64]
    missed: NDArray[np.float64]
    held: NDArray[np.float64]
    is_noise: NDArray[np.bool_]
    factors: NDArray[np.float64]
    index: int = -1

    @property
    def useful(self) -> bool:
        """Whether each channel is forecast at least as well as by the mean of its samples."""
        return bool(np.isfinite(self.factors).all())

    def to_frame(self) -> "DataFrame":
        """Return the scores as a pandas DataFrame, with a row for each channel.

        The index has the names of the channels. The columns are `skill`, `missed`, `held`,
        `is_noise` and `factor`.
        """
        import pandas as pd  # an extra, and slow to import

        scores = {
            "skill": self.skill, "missed": self.missed, "held": self.held,
            "is_noise": self.is_noise, "factor": self.factors,
        }  # fmt: skip
        return pd.DataFrame(scores, pd.Index(self.forecast.names, name="channel"))


def score_forecast(
    ahead: Forecast, measured: np.ndarray, deviation: np.ndarray, noise: np.ndarray
) -> ScoredForecast:
    """Score a forecast by comparison with the samples measured at its times.

    measured: (n, n_sensed) samples, NaN where missing. deviation: (n_sensed,) of the whole
    recording, which the errors of a useful forecast do not reach. noise: (n_sensed,) of a sample,
    zero where unknown.
    """
    is_finite = np.isfinite(measured)
    error = np.where(is_finite, measured - ahead.median, 0.0)
    is_inside = is_finite & (measured >= ahead.low) & (measured <= ahead.high)
    counts, squares = is_finite.sum(axis=0), np.sum(error**2, axis=0)
    factors = np.ones(len(counts))
    with np.errstate(invalid="ignore", divide="ignore"):
        skill = 1.0 - squares / (counts * deviations_of(measured) ** 2)
        missed = np.sqrt(squares / counts) / deviation
        coverage = is_inside.sum(axis=0) / counts
        relative = np.maximum(
            error / (ahead.high - ahead.median), error / (ahead.low - ahead.median)
        )  # to the half width of the band on the side of the sample
    for k in np.flatnonzero(coverage < ahead.chance):
        is_useless = skill[k] <= 0.0 and squares[k] > counts[k] * deviation[k] ** 2
        factors[k] = np.inf if is_useless else np.quantile(relative[is_finite[:, k], k], 0.9)
    by_chance = 1.0 + MAX_NOISE_EXCESS * np.sqrt(2.0 / np.maximum(counts, 1))
    is_noise = deviations_of(measured) < noise * np.sqrt(by_chance)
    return ScoredForecast(ahead, skill, missed, coverage, is_noise, factors)


def with_factors(identified: IdentifiedModel, trial: ScoredForecast) -> IdentifiedModel:
    """Add to the diagnostics of a model the factors by which its forecast bands are widened."""
    factors = {
        f"{WIDENING_PREFIX}{name}": float(factor)
        for name, factor in zip(trial.forecast.names, trial.factors, strict=True)
        if factor != 1.0
    }
    return replace(identified, diagnostics={**identified.diagnostics, **factors})


def _compute_quantiles(motions: np.ndarray, levels: Sequence[float]) -> np.ndarray:
    """Compute quantiles, (n_levels, n, n_sensed), of the draws that do not diverge."""
    diverged = ~np.isfinite(motions).all(axis=(0, 2))
    with np.errstate(invalid="ignore"):  # between two infinite values
        quantiles = np.quantile(motions, levels, axis=0, method="weibull")
    if diverged.any():
        quantiles[:, diverged] = np.nanquantile(
            motions[:, diverged], levels, axis=0, method="weibull"
        )
    return quantiles


def check_followed(identified: IdentifiedModel, recording: Recording, window: float) -> None:
    """Raise ValueError if a model does not fit the end of a recording within the noise.

    The message is one line. The initial states of the model are fitted to N_ORIGINS windows of
    `window` s, within the last HORIZON_WINDOWS times that length. An approximate model may err
    as much as on the recordings from which it was identified.
    """
    recording = without_outliers(recording)
    if identified.is_forced:
        return in_random_forces.check_followed(identified, recording)
    follow = Following(identified, recording)
    time, sigma = recording.time, follow.sigma
    allowed = MAX_MISFIT
    if identified.status == "approximate":
        allowed *= max(identified.chi2, 1.0)
    misfits = []
    last = max(time[-1] - window, time[0])
    for begin in np.linspace(max(time[-1] - HORIZON_WINDOWS * window, time[0]), last, N_ORIGINS):
        rows = slice(*first_from(time, (begin, begin + window)))
        values = follow.samples[rows]
        if np.isfinite(values[:, sigma > 0]).sum() < MIN_WINDOW_SAMPLES * len(sigma):
            continue
        start = follow.fit_start(rows)
        motion = None if start is None else follow.motion(identified.model, start, time[rows])
        misfits.append(np.inf if motion is None else follow.misfit(motion, values))
    if misfits and not np.median(misfits) <= allowed:
        names = follow.sensed.names
        noise = ", ".join(
            f"{name} {each:.2g}" for name, each in zip(names, sigma, strict=True) if each > 0
        )
        raise ValueError(
            "the model does not follow the recording: over "
            f"{min(window, np.ptp(time)):.3g} s it misses the samples "
            f"by {np.sqrt(np.median(misfits)):.3g} times their noise ({noise}), where "
            f"{np.sqrt(allowed):.3g} is allowed: another line, another wind, or another sensor"
        )


def _draw_motions(
    follow: Following, time: np.ndarray, window: float, worst: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw motions at `time`, (n_draws, n, n_sensed), NaN from where one diverges.

    worst: misfit, as of `Following.misfit`, above which a draw is left out.
    """
    best, recording, sigma = follow.identified.model, follow.recording, follow.sigma
    begin = int(first_from(recording.time, recording.time[-1] - window))
    rows = slice(begin, None, 1 + (len(recording.time) - begin) // MAX_SAMPLES)
    sampled, values = recording.time[rows], follow.samples[rows]
    if len(sampled) < len(recording.states):
        raise ValueError(
            f"the last {min(window, np.ptp(recording.time)):.3g} s of the recording hold "
            f"{len(sampled)} samples; a forecast needs "
            f"{len(recording.states)} or more to start from"
        )
    best_start = follow.fit_start(rows)
    motions = []
    if best_start is None:
        return np.empty((0, len(time), len(sigma)))
    best_motion = follow.motion(best, best_start, sampled)
    if follow.misfit(best_motion, values) < worst:
        slopes = follow.differentiate(best, best_start, best_motion, sampled)
        for model in draw_models(follow.identified, rng, FORECAST_DRAWS):
            passing("draw models and starts")
            noisy = values + sigma * rng.standard_normal(values.shape)
            start = follow.fit_start_of(model, rows, best_start, noisy, slopes)
            if start is None:
                continue
            motion = follow.motion(model, start, np.concatenate([sampled, time]))
            if follow.misfit(motion[: len(sampled)], noisy) < 2.0 * worst:  # noise was added again
                motions.append(motion[len(sampled) :])
    return np.array(motions).reshape(-1, len(time), len(sigma))


def _compute_past_errors(follow: Following, ahead: np.ndarray, window: float) -> np.ndarray:
    """Compute root mean square errors, (n, n_sensed), of forecasts from earlier windows.

    ahead: (n,) s, times of the forecast after the end of the recording. Noise is included. The
    forecasts begin at N_ORIGINS times in the later half of the recording, and last HORIZON_WINDOWS
    windows or a quarter of the recording. Their errors are averaged over each of PARTS_PER_WINDOW
    parts of a window, and made non-decreasing. Beyond, they grow with time, as phase errors do, up
    to the difference of two unrelated motions of the channel.
    """
    time, values = follow.recording.time, follow.samples
    quarter = (time[-1] - time[0]) / 4
    length = min(window, quarter) / PARTS_PER_WINDOW
    parts = round_down(min(HORIZON_WINDOWS * window, quarter) / length)
    horizon = parts * length
    squares, counts = np.zeros((2, parts, values.shape[1]))
    for origin in np.linspace(time[0] + (time[-1] - time[0]) / 2, time[-1] - horizon, N_ORIGINS):
        begin, now, end = first_from(time, (origin - window, origin, origin + horizon))
        if now - begin < len(values[0]):
            continue  # the window falls into a gap
        start = follow.fit_start(slice(begin, now))
        if start is None:
            continue
        motion = follow.motion(follow.identified.model, start, time[begin:end])[now - begin :]
        part = ((time[now:end] - origin) / length + TIME_ROUNDING).astype(int)
        part = np.clip(part, 0, parts - 1)
        error = values[now:end] - motion
        is_finite = np.isfinite(error)
        np.add.at(squares, part, np.where(is_finite, error, 0.0) ** 2)
        np.add.at(counts, part, is_finite)
    if not counts.any():
        raise ValueError("no earlier part of the recording shows the errors of forecasts")
    missed = np.maximum.accumulate(np.sqrt(squares / np.maximum(counts, 1)), axis=0)
    centres = (np.arange(parts) + 0.5) * length
    inside = np.column_stack([np.interp(ahead, centres, each) for each in missed.T])
    most = np.maximum(np.sqrt(2.0) * deviations_of(values), missed[-1])
    later = np.maximum(ahead / centres[-1], 1.0)[:, np.newaxis]
    return np.where(later > 1.0, np.minimum(inside * later, most), inside)


def _extend_inputs(
    model: PolynomialModel,
    recording: Recording,
    time: np.ndarray,
    ahead: Mapping[str, Input | float],
) -> Recording:
    """Extend the recording's inputs of a model up to the end of `time`, s.

    ahead: by name, inputs after the recording: measured, or a constant. Raises ValueError if one is
    not known.
    """
    inputs = dict(recording.inputs)
    for name in model.inputs:
        if name in ahead:
            inputs[name] = _continue(name, inputs[name], ahead[name], recording.time[-1], time[-1])
        elif not inputs[name].covered(time).all():
            mean = np.nanmean(inputs[name].values)
            raise ValueError(
                f"the model is driven by {name}: give its values after the recording, in a file "
                f"(--inputs FILE) or constant (--at {name}={mean:.3g})"
            )
    return replace(recording, inputs=inputs)


def _continue(
    name: str, recorded_input: Input, ahead: Input | float, end: float, last_time: float
) -> Input:
    """Continue an input after `end`, s, at the sampling interval of its past."""
    is_past = recorded_input.time <= end
    step = float(np.median(np.diff(recorded_input.time)))
    time = np.arange(recorded_input.time[is_past][-1] + step, last_time + 2 * step, step)
    if isinstance(ahead, Input):
        values = ahead(time)
        is_finite = np.isfinite(values)
        is_short_gap = (time < ahead.stretches[0][0]) & (time < end + MAX_INTERPOLATED_STEPS * step)
        is_beyond = time > last_time
        if not is_finite.any() or not np.all(is_finite | is_short_gap | is_beyond):
            first, last = ahead.stretches[0][0], ahead.stretches[-1][1]
            raise ValueError(
                f"input {name} is known from {first:g} to {last:g} s, with "
                f"{len(ahead.stretches) - 1} gaps; needed from {end:g} to {last_time:g} s, by the "
                "clock of the recording"
            )
        values = np.interp(time, time[is_finite], values[is_finite])
    else:
        values = np.full(len(time), float(ahead))
    return replace(
        recorded_input,
        time=np.append(recorded_input.time[is_past], time),
        values=np.append(recorded_input.values[is_past], values),
    )
