"""Figures of a model and its recordings, each in one call; they need matplotlib."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from galloping.arrays import one_thread
from galloping.behaviour.following import Following, check_recordings, without_outliers
from galloping.estimator import MaximumLikelihood
from galloping.identification.identified_model import IdentifiedModel
from galloping.model.polynomial import velocity_pairs
from galloping.readers.units import EMPTY_MAPPING
from galloping.recording.samples import Input, Recording
from galloping.summary.summarise import START_PERIODS, forecast, longest_period, simulate_beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Found: TypeAlias = MaximumLikelihood | IdentifiedModel
Recordings: TypeAlias = Recording | Sequence[Recording] | None


@one_thread
def plot_fit(found: Found, recordings: Recordings = None) -> "Figure":
    """Plot the samples of a recording and the simulated motion of the model over time.

    Parameters
    ----------
    found : MaximumLikelihood or IdentifiedModel
        A fitted estimator, or a model with its `recordings`.
    recordings : Recording or sequence of Recording, optional
        The last is drawn; by default those of the estimator.

    Returns
    -------
    Figure
        A row for each state, and columns for the first, middle and last part of the recording, in
        each of which the model starts again. For a model with random forces, the spectra.
    """
    from galloping.figures.style import styled
    from galloping.summary.drawing import FONT_SIZE, draw_fit, draw_spectra

    model, recording_list = _model_of(found, recordings)
    with styled(FONT_SIZE):
        if model.is_forced:
            return draw_spectra(model, recording_list[-1])
        length = min(
            START_PERIODS * longest_period(recording_list), np.ptp(recording_list[-1].time)
        )
        return draw_fit(recording_list[-1], simulate_beside(model, recording_list[-1], length))


@one_thread
def plot_forecast(
    found: Found,
    recordings: Recordings = None,
    time: ArrayLike | None = None,
    *,
    inputs: Mapping[str, Input | float] = EMPTY_MAPPING,
    seed: int = 0,
) -> "Figure":
    """Plot the end of a recording and the model's forecast after it, with a 90 % band.

    Parameters
    ----------
    found, recordings : as of `plot_fit`
    time : (n,) array, optional
        Times after the recording, s; by default six periods of the motion.
    inputs : mapping
        Inputs after the recording, by name, measured or constant.
    seed : int
        Seed of the random numbers for the band.

    Returns
    -------
    Figure
        A row for each channel.

    Raises
    ------
    ValueError
        If there is no forecast, as of `forecast`.
    """
    from galloping.figures.style import styled
    from galloping.summary.drawing import FONT_SIZE, draw_forecast

    model, recording_list = _model_of(found, recordings)
    ahead = forecast(model, recording_list[-1], time, inputs=inputs, seed=seed)
    with styled(FONT_SIZE):
        return draw_forecast(
            [recording_list[-1]], [ahead], float(ahead.time[-1] - recording_list[-1].time[-1])
        )


@one_thread
def plot_phase(
    found: Found, recordings: Recordings = None, states: Sequence[str] | None = None
) -> "Figure":
    """Plot a phase portrait of recorded samples and the simulated motion of the model.

    Parameters
    ----------
    found, recordings : as of `plot_fit`
    states : sequence of str, optional
        Two or three states as axes: by default a displacement and its velocity, or the first two.

    Returns
    -------
    Figure
        The motion starts from the state that fits the first six periods of the last recording best,
        and continues to its end. It is not drawn after it diverges.

    Raises
    ------
    ValueError
        If `states` are not two or three states of the model, or the model has random forces.
    """
    from galloping.figures import parts
    from galloping.figures.style import MODEL_COLOR, TRUE_COLOR, styled
    from galloping.summary.drawing import FONT_SIZE

    model, recording_list = _model_of(found, recordings)
    names, recording = model.model.states, recording_list[-1]
    if model.is_forced:
        raise ValueError("plot_phase: random forces move the model; plot_fit draws its spectra")
    pairs = velocity_pairs(names)
    default = tuple(names[k] for k in next(iter(pairs.items()))) if pairs else names[:2]
    axis_states = default if states is None else tuple(states)
    if len(axis_states) not in (2, 3) or not set(axis_states) <= set(names):
        allowed = f"must be two or three of {', '.join(names)}"
        raise ValueError(f"states: {list(axis_states)!r:.60}; {allowed}")
    columns = [names.index(name) for name in axis_states]
    follow, time = Following(model, without_outliers(recording)), recording.time
    first_periods = slice(
        0, int(np.searchsorted(time, time[0] + START_PERIODS * longest_period(recording_list)))
    )
    start = follow.fit_start(first_periods)
    with styled(FONT_SIZE):
        projection = "3d" if len(axis_states) == 3 else None
        figure, ((axes,),) = parts.panels(3.4, width=4.2, subplot_kw={"projection": projection})
        axes.plot(*recording.values[:, columns].T, ".", ms=2, color=TRUE_COLOR, label="samples")
        if start is not None:
            motion = follow.motion(model.model, start, time)
            axes.plot(*motion[:, columns].T, color=MODEL_COLOR, lw=0.7, label="model")
        axes.set(**dict(zip(("xlabel", "ylabel", "zlabel"), axis_states, strict=False)))
        parts.legend(figure)
    return figure


def _model_of(fit: Found, recordings: Recordings) -> tuple[IdentifiedModel, list[Recording]]:
    """Return the model and the recordings to draw; raise ValueError if they do not fit."""
    if isinstance(fit, MaximumLikelihood):
        recordings = fit.recordings_ if recordings is None else recordings
        fit = fit.model_
    if not isinstance(fit, IdentifiedModel):
        kinds = "a fitted MaximumLikelihood or an IdentifiedModel"
        raise ValueError(f"found: a {type(fit).__name__}; must be {kinds}")
    if fit.status == "refused":
        raise ValueError(f"there is no model to draw: {fit.reason}")
    return fit, check_recordings(fit.model, recordings)
