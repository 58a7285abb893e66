"""Accuracy of the paper's two-mode model: its motion compared with that of the continuous line."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.cycles.family import initial_state
from galloping.evaluation.motion import r_squared, steady_amplitude, steady_frequency
from galloping.line import continuous
from galloping.streams import make_generator

SAMPLE_RATE = 50  # sampling rate, Hz
INTEGRATION_STEP = 0.02  # step, s: with a quarter of it, motions differ by 0.1 mm after 300 s
WINDOWS = ((0, 100), (100, 200), (200, 300))  # begin and end of windows that are compared, s
STEADY_WINDOW = WINDOWS[-1]  # window of amplitude and frequency, s
LIMIT_CYCLE_WINDOW = (1400, 1500)  # window of the limit cycle, s: the slowest approach has died out
DIRECTIONS = ("vertical", "horizontal")
MAX_RATIO = 2.0  # largest ratio between amplitudes or frequencies of a common motion


@dataclass(frozen=True)
class LineVariant:
    """Variant of the continuous line that is compared with the two-mode model.

    Parameters are as in `continuous`. antisymmetric: m, of its initial displacement.
    """

    modes: int
    aerodynamics: str = "small_angle"
    drag: float = 0.0
    antisymmetric: float = 0.0
    intensity: float = 0.0


VARIANTS = {
    "1 mode": LineVariant(1),
    **{f"{n} modes": LineVariant(n) for n in (3, 5, 7, 9, 13)},
    "relative wind": LineVariant(9, "relative"),
    "relative, drag 0.2": LineVariant(9, "relative", 0.2),
    "gusts 2 %": LineVariant(9, intensity=0.02),
    "gusts 5 %": LineVariant(9, intensity=0.05),
    "antisymmetric 1 mm": LineVariant(9, antisymmetric=1e-3),
    "antisymmetric 10 mm": LineVariant(9, antisymmetric=1e-2),
}


def reduction_table(settings: Mapping) -> pd.DataFrame:
    """Tabulate the errors of the two-mode model against lines with many modes, gusts and drag.

    The table is that of `reduction` for VARIANTS. settings: case; seed, length_scale and spectrum
    of the gusts.
    """
    case, gusts = settings["case"], {k: settings[k] for k in ("seed", "length_scale", "spectrum")}
    return reduction(case, {name: variant_motion(case, v, **gusts) for name, v in VARIANTS.items()})


def variant_motion(
    case: Mapping, variant: LineVariant, *, length_scale: float, spectrum: str, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate a continuous line from the initial displacement of the two-mode model.

    Returns the motion at mid-span, and half of the difference between both quarters of the span:
    (n, 2) m each, vertical and horizontal. The keywords are of the gusts.
    """
    line = continuous.continuous_line(
        case, variant.modes, aerodynamic=variant.aerodynamics, drag=variant.drag
    )
    start = initial_state(case)
    state = continuous.displaced_state(
        line, start[:2], start[2:], antisymmetric=variant.antisymmetric
    )
    gusts = {"intensity": variant.intensity, "length_scale": length_scale, "spectrum": spectrum}
    speed = continuous.draw_wind(
        line, gusts, _sample_times(), make_generator(seed, "reduction", "gusts")
    )
    return _simulate_release(line, state, speed)


def _sample_times() -> np.ndarray:
    return np.arange(LIMIT_CYCLE_WINDOW[1] * SAMPLE_RATE + 1) / SAMPLE_RATE


def _simulate_release(
    line: continuous.Span, start: np.ndarray, speed: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    states = continuous.simulate(line, start, _sample_times(), speed, INTEGRATION_STEP)
    displacements = continuous.sensor_readings(line, states, continuous.SENSOR_POSITIONS)[..., :2]
    left, middle, right = np.moveaxis(displacements, 1, 0)
    return middle, (left - right) / 2.0


def reduction(case: Mapping, motions: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> pd.DataFrame:
    """Tabulate amplitude and frequency errors of the two-mode model against continuous lines.

    There is a row for each line and direction. motions: of the lines, as `variant_motion` returns
    them, at mid-span. Amplitude and frequency are those of 200-300 s; limit_cycle_m is the
    amplitude after 1400 s. Errors are those of the two-mode model against the line, NaN if the two
    differ in either direction by more than MAX_RATIO and so have no common motion; R2 is of its
    displacement, over stretches of 100 s, since phases drift apart. antisymmetric_m, the amplitude
    of the limit cycle at a quarter of the span in antisymmetric modes, is not part of the two-mode
    model.
    """
    model = _simulate_release(continuous.continuous_line(case, 0), np.array(initial_state(case)))
    expected, tables = _describe_motion(*model), []
    for name, motion in {"two modes": model, **motions}.items():
        values = _describe_motion(*motion)
        row: dict[str, object] = {"line": name, "direction": DIRECTIONS}
        for quantity in ("amplitude_m", "frequency_hz", "limit_cycle_m"):
            ratio = expected[quantity] / values[quantity]
            is_common = np.all((ratio >= 1 / MAX_RATIO) & (ratio <= MAX_RATIO))
            row[quantity] = values[quantity]
            error = f"{quantity.rsplit('_', 1)[0]}_error_percent"
            row[error] = 100.0 * (ratio - 1.0) if is_common else np.nan
        for begin, end in WINDOWS:
            part = _samples_between(begin, end)
            row[f"r2_{begin}_{end}_s"] = r_squared(motion[0][part], model[0][part])
        tables.append(pd.DataFrame({**row, "antisymmetric_m": values["antisymmetric_m"]}))
    return pd.concat(tables, ignore_index=True)


def _samples_between(begin: float, end: float) -> np.ndarray:
    return (_sample_times() >= begin) & (_sample_times() <= end)


def _describe_motion(mid_span: np.ndarray, antisymmetric: np.ndarray) -> dict[str, np.ndarray]:
    """Compute amplitude, frequency, limit cycle and antisymmetric motion, (2,) each."""
    steady, settled = _samples_between(*STEADY_WINDOW), _samples_between(*LIMIT_CYCLE_WINDOW)
    return {
        "amplitude_m": steady_amplitude(mid_span[steady]),
        "frequency_hz": steady_frequency(mid_span[steady], 1.0 / SAMPLE_RATE),
        "limit_cycle_m": steady_amplitude(mid_span[settled]),
        "antisymmetric_m": steady_amplitude(antisymmetric[settled]),
    }
