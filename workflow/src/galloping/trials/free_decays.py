"""Trials of free decays with a weak second mode, as after plucking or an impact.

Frequencies, damping, sampling, noise and the rest before the release are drawn. Frequency and
damping of both modes are assessed, those of the first also against the Cramér-Rao bound.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.model.intervals import NORMAL_95
from galloping.model.polynomial import polynomial_library
from galloping.recording.samples import Recording
from galloping.streams import make_generator
from galloping.trials.attempts import draw_log_uniform, identify_once
from galloping.trials.real_lines import DEGREE, start_row

STATES = ("q", "dq")
TERMS = polynomial_library(len(STATES), DEGREE)
SENSORS = ("displacement", "acceleration")
FREQUENCIES, DAMPING = (0.05, 50.0), (0.001, 0.03)  # Hz, first mode; damping ratio
AMPLITUDE_RATIOS = (0.002, 0.1)  # measured amplitude of the second mode over that of the first
FREQUENCY_RATIOS = (1.15, 6.0)  # ratio of the two frequencies, or its inverse
SAMPLES, SAMPLES_PER_PERIOD = (200, 20_000), (8.0, 60.0)
MIN_PERIODS = 10.0  # periods of the first mode in a recording
NOISE_LEVELS = (0.001, 0.03)  # noise of a sample over the initial amplitude
REST_SHARES = (0.03, 0.3)  # share of samples before the release, in every other recording
MIN_SECOND_SAMPLES = 2.5  # samples in a period of the second mode


@dataclass(frozen=True)
class FreeDecay:
    """Simulated free decay of two modes, with its noisy recording and Cramér-Rao bound.

    The sensor measures displacement or acceleration. poles: (2,) complex, 1/s; the first is that of
    the mode with the larger amplitude. sensor: one of SENSORS. bound: (2,) standard deviations at
    the Cramér-Rao bound of growth, 1/s, and frequency, rad/s, of the first mode.
    """

    poles: np.ndarray
    sensor: str
    bound: np.ndarray
    recording: Recording

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "FreeDecay":
        """Sample two random modes and a sensor, and simulate their free decay with noise.

        They are drawn within the ranges above.
        """
        count = round(draw_log_uniform(rng, SAMPLES))
        per_period = min(draw_log_uniform(rng, SAMPLES_PER_PERIOD), count / MIN_PERIODS)
        frequency, damping = draw_log_uniform(rng, FREQUENCIES), draw_log_uniform(rng, DAMPING, 2)
        ratio = rng.uniform(
            FREQUENCY_RATIOS[0], min(FREQUENCY_RATIOS[1], per_period / MIN_SECOND_SAMPLES)
        )
        ratio = ratio if rng.random() < 0.5 else 1.0 / ratio
        omega = 2.0 * np.pi * frequency * np.array([1.0, ratio])
        poles = -damping * omega + 1j * omega * np.sqrt(1.0 - damping**2)
        phases = np.exp(2j * np.pi * rng.random(2))
        amplitudes = phases * np.array([1.0, draw_log_uniform(rng, AMPLITUDE_RATIOS)])
        noise, sensor = draw_log_uniform(rng, NOISE_LEVELS), SENSORS[rng.integers(2)]
        time = np.arange(count) / (per_period * frequency)
        n_rest = round(rng.uniform(*REST_SHARES) * count) if rng.random() < 0.5 else 0
        elapsed = time[n_rest:] - time[n_rest]
        motion = np.zeros(count)
        motion[n_rest:] = (np.exp(np.outer(elapsed, poles)) @ amplitudes).real
        if sensor == "displacement" and rng.random() < 0.5:
            motion[:n_rest] = motion[n_rest]  # held until it is released
        samples = motion + noise * rng.standard_normal(count)
        values, rates = np.full((2, count, 2), np.nan)
        if sensor == "displacement":
            values[:, 0] = samples
            recording = Recording(time, STATES, values)
        else:
            rates[:, 1] = samples
            offsets = np.array([False, True])
            recording = Recording(time, STATES, values, rates=rates, unknown_offsets=offsets)
        return cls(poles, sensor, _decay_bound(elapsed, poles, amplitudes, noise), recording)


def _decay_bound(
    time: np.ndarray, poles: np.ndarray, amplitudes: np.ndarray, noise: float
) -> np.ndarray:
    """Compute the Cramér-Rao bound of growth and frequency of the first mode, (2,)."""
    waves = np.exp(np.outer(time, poles))
    slope, ones = time[:, np.newaxis] * waves * amplitudes, np.ones((len(time), 1))
    slopes = np.hstack([slope.real, -slope.imag, waves.real, -waves.imag, ones])
    scale = np.linalg.norm(slopes, axis=0)
    covariance = np.linalg.inv((slopes / scale).T @ (slopes / scale)) / np.outer(scale, scale)
    return noise * np.sqrt(np.diag(covariance)[[0, 2]])


def trial(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """Identify simulated free decays of two modes; yield a row of errors for each fit.

    There is a fit for each replicate and method, with the columns of `real_lines.trial`. The first
    mode is the vertical one. coverage: of frequency and damping of the first mode, nothing if they
    are unknown. Seconds are those of the processor.
    """
    for replicate in replicates:
        decay = FreeDecay.draw(make_generator(seed, "free_decays", case, replicate))
        for method, settings in methods.items():
            name = ("free_decays", case, str(replicate))
            identified, answer = identify_once({method: settings}, [decay.recording], TERMS, name)
            row = start_row(case, decay.sensor, replicate, seed, answer)
            yield row | (_judge_decay(decay, identified) if identified.status != "refused" else {})


def _judge_decay(decay: FreeDecay, identified: IdentifiedModel) -> dict[str, float]:
    first, second = decay.poles
    pole, errors = estimate_pole(identified)
    row = {
        "terms": int(identified.support.sum()),
        **_pole_errors("v", pole, first),
        "damping_v_bound_percent": -100.0 * decay.bound[0] / first.real,
    }
    if np.all(errors > 0.0):
        off = np.abs([pole.real - first.real, pole.imag - first.imag])
        row["coverage"] = float(np.mean(off <= NORMAL_95 * errors))
    further = {complex(mode.growth, mode.frequency) for mode in identified.further_modes}
    if further:
        row |= _pole_errors("w", min(further, key=lambda each: abs(each - second)), second)
    return row


def estimate_pole(identified: IdentifiedModel) -> tuple[complex, np.ndarray]:
    """Compute growth rate and frequency of a model's small motions, with standard errors.

    The model has one coordinate. Returns growth, 1/s, and frequency, rad/s, of small motions as
    real and imaginary part; and their standard errors, (2,), by those of the linear coefficients.
    """
    stiffness, damping = identified.model.jacobian(np.zeros((1, 2)))[0][1]
    growth = damping / 2.0
    omega = np.sqrt(max(-stiffness - growth**2, np.finfo(float).tiny))
    slope = {(1, 0): (0.0, -0.5 / omega), (0, 1): (0.5, -0.5 * growth / omega)}
    terms = [identified.model.terms[j] for _, j in np.argwhere(identified.support)]
    slopes = np.array([slope.get(term, (0.0, 0.0)) for term in terms])
    return complex(growth, omega), np.sqrt(np.diag(slopes.T @ identified.covariance @ slopes))


def _pole_errors(direction: str, pole: complex, true: complex) -> dict[str, float]:
    return {
        f"damping_{direction}_error_percent": 100.0 * (pole.real / true.real - 1.0),
        f"frequency_{direction}_error_percent": 100.0 * (pole.imag / true.imag - 1.0),
    }
