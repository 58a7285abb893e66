"""Oscillations that a recording holds besides its model, as a line's higher modes make them.

Each is a line in the spectrum of what the model leaves, above the frequencies of the motion, where
errors of the model itself are small: a sinusoid that grows or decays exponentially.
"""

from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.residual_tests import NEIGHBOURS, RESIDUAL_RATE, ROUNDING
from galloping.identification.model import FurtherMode
from galloping.polynomial import velocity_pairs


def further_modes(
    states: tuple[str, ...], condensed: Condensed, residual: np.ndarray
) -> tuple[FurtherMode, ...]:
    """The oscillations that stand out of what a model leaves, each recording and channel by itself.

    residual: (n_windows, n_observed, n_rows) projections of the samples less those of the model,
    not finite where the model diverges. Channels that measure the rate of another are left out.
    """
    found: list[FurtherMode] = []
    own = condensed.observed[~condensed.is_rate]
    rates = {v for i, v in velocity_pairs(states).items() if i in own}
    weights = condensed.samplings[:, :, 0, 0]
    for r, (a, b) in enumerate(pairwise(condensed.first)):
        for o, i in enumerate(condensed.observed):
            left, data = residual[a:b, o, 0], condensed.targets[a:b, o, 0]
            sampled = np.flatnonzero((weights[a:b, o] > 0.0) & np.isfinite(left))
            exact = np.linalg.norm(left[sampled]) < ROUNDING * np.linalg.norm(data)
            few = len(sampled) < max((b - a) / 2, NEIGHBOURS)
            if condensed.is_rate[o] or i in rates or exact or few:
                continue
            means = left[sampled] / weights[a:b, o][sampled]
            main = 1 + np.argmax(np.abs(np.fft.rfft(data)[1:]))
            lowest = 1.5 * main / (b - a) / condensed.step  # Hz; below are the model's errors
            time = condensed.step * (sampled + 0.5)
            modes = _oscillations(time, means, condensed.step, lowest)
            found += [FurtherMode(r, states[i], *mode) for mode in modes]
    return tuple(found)


def modes_in_words(modes: tuple[FurtherMode, ...]) -> str:
    """Further modes as the end of a reason, '' where there are none."""
    lines: dict[str, set[str]] = {}
    for mode in modes:
        lines.setdefault(mode.state, set()).add(f"{mode.frequency / (2.0 * np.pi):.3g}")
    parts = [f"{state} at {', '.join(sorted(hz, key=float))} Hz" for state, hz in lines.items()]
    return f"; besides it there oscillates {', and '.join(parts)}" if parts else ""


def _oscillations(
    time: np.ndarray, values: np.ndarray, window: float, lowest: float
) -> list[tuple[float, float, float, float]]:
    """Frequency, growth, cosine and sine of four at most, the strongest first, as in `FurtherMode`.

    values: (n,) means over windows, s, about the times (n,), of which some may be missing. lowest:
    frequency, Hz.
    """
    found = []
    duration = time[-1] - time[0] + window
    for _ in range(4):
        regular = np.zeros(round(duration / window))
        regular[((time - time[0]) / window).round().astype(int)] = values
        power = np.abs(np.fft.rfft(regular)[1:]) ** 2
        frequency = np.arange(1, len(power) + 1) / duration
        band = (frequency > lowest) & (frequency < 0.4 / window)  # above, a mean tells little
        if not band.any():
            break
        # bins of noise are exponentially distributed, with a median of ln 2 of their mean
        most = np.median(power[band]) / np.log(2.0) * np.log(band.sum() / RESIDUAL_RATE)
        place = np.argmax(np.where(band, power, 0.0))
        if not power[place] > most:
            break
        *mode, fitted = _fitted(time, values, 2.0 * np.pi * frequency[place])
        remainder = values - fitted
        if remainder @ remainder > 0.9 * (values @ values):
            break  # only a mode that takes a tenth of what is left is worth a word
        omega, growth, cosine, sine = mode
        inside = np.sinc(omega * window / (2.0 * np.pi))  # share left in a mean over a window
        found.append((omega, growth, cosine / inside, sine / inside))
        values = remainder
    return found


def _fitted(
    time: np.ndarray, values: np.ndarray, frequency: float
) -> tuple[float, float, float, float, np.ndarray]:
    """The best oscillation near `frequency`, rad/s, as in `FurtherMode`, and its values (n,)."""
    duration = time[-1] - time[0]

    def basis(place: np.ndarray) -> np.ndarray:
        # in units of its size at the middle, so that neither end is lost in rounding
        size = np.exp(place[0] * (time / duration - 0.5))
        angle = (frequency + place[1] / duration) * time
        return size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])

    def solved(place: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(basis(place), values, rcond=None)[0]

    def left(place: np.ndarray) -> np.ndarray:
        return values - basis(place) @ solved(place)

    most = np.array([20.0, 2.0 * np.pi])  # what grows more is at the end of a record alone
    # growth has more than one minimum: tried are none, and twentyfold over the record either way
    tried = [
        least_squares(left, [growth, 0.0], bounds=(-most, most)) for growth in (0.0, 3.0, -3.0)
    ]
    best = min(tried, key=lambda each: each.cost).x
    cosine, sine = solved(best) * np.exp(-best[0] / 2.0)
    rate = best[0] / duration
    return frequency + best[1] / duration, rate, cosine, sine, basis(best) @ solved(best)
