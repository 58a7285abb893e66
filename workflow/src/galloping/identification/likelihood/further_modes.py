"""Oscillations of a recording besides its model, such as a line's higher modes.

Each is a line in the spectrum of the model's residual, above the frequencies of the motion, where
errors of the model itself are small: a sinusoid that grows or decays exponentially.
"""

from itertools import pairwise

import numpy as np

from galloping.identification.free_motion.damped_modes import Stretch, fit_poles
from galloping.identification.free_motion.mode_search import strongest_mode
from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.residual_tests import MIN_RESIDUAL, NEIGHBOUR_BINS
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.oscillations import FurtherMode

MIN_POWER_SHARE = 0.1  # least share of the residual's power that a reported mode explains
# Most periods of a mode in a window. Means over windows show little of faster modes.
MAX_WINDOW_PERIODS = 0.4


def find_further_modes(condensed: Condensed, residual: np.ndarray) -> tuple[FurtherMode, ...]:
    """Find oscillations in the residuals of a model, in each recording and channel separately.

    residual: (n_windows, n_observed, n_rows) projections of the samples less those of the model,
    not finite if the model diverges. Channels that measure the rate of another are left out.
    """
    modes: list[FurtherMode] = []
    channels = condensed.channels
    rates = {velocity for i, velocity in channels.pairs.items() if i in channels.values}
    weights = condensed.samplings[:, :, 0, 0]
    for r, (a, b) in enumerate(pairwise(condensed.first)):
        for o, i in enumerate(channels.values):
            series, data = residual[a:b, o, 0], condensed.motion[a:b, o, 0]
            sampled = np.flatnonzero((weights[a:b, o] > 0.0) & np.isfinite(series))
            is_exact = np.linalg.norm(series[sampled]) < MIN_RESIDUAL * np.linalg.norm(data)
            is_short = len(sampled) < max((b - a) / 2, NEIGHBOUR_BINS)
            if i in rates or is_exact or is_short:
                continue
            means = series[sampled] / weights[a:b, o][sampled]
            main = 1 + np.argmax(np.abs(np.fft.rfft(data)[1:]))
            lowest = 1.5 * main / (b - a) / condensed.step  # Hz; below are the model's errors
            time = condensed.step * (sampled + 0.5)
            oscillations = _find_oscillations(time, means, condensed.step, lowest)
            modes += [FurtherMode(r, channels.states[i], *each) for each in oscillations]
    return tuple(modes)


def _find_oscillations(
    time: np.ndarray, values: np.ndarray, window: float, lowest: float
) -> list[tuple[float, float, float, float]]:
    """Find frequency, growth, cosine and sine of the strongest oscillations, as in `FurtherMode`.

    There are at most four, the strongest first. values: (n,) means over windows, s, about the
    times (n,), of which some may be missing. lowest: frequency, Hz.
    """
    stretch = Stretch(time - time[0], values[:, np.newaxis], (0,))
    band = 2.0 * np.pi * lowest, 2.0 * np.pi * MAX_WINDOW_PERIODS / window
    poles, amplitudes, residual = np.empty(0, complex), np.empty(0, complex), values - values.mean()
    for _ in range(4):
        best = strongest_mode([stretch], [residual[:, np.newaxis]], poles, band=band)
        if best is None:
            break
        fit = attempt(fit_poles, [stretch], np.append(poles, best))
        if isinstance(fit, NoModel):
            break
        remainder = fit.residuals[0][:, 0]
        if remainder @ remainder > (1.0 - MIN_POWER_SHARE) * (residual @ residual):
            break
        poles, amplitudes, residual = fit.poles, fit.amplitudes[0][:, 0], remainder
    modes = []
    for pole, amplitude in zip(poles, amplitudes, strict=True):
        begin = amplitude * np.exp(-pole * time[0])  # at the first sample
        inside = np.sinc(pole.imag * window / (2.0 * np.pi))  # share left in a mean over a window
        cosine, sine = begin.real / inside, -begin.imag / inside
        modes.append((float(pole.imag), float(pole.real), float(cosine), float(sine)))
    return modes
