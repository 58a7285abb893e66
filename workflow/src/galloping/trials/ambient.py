"""Trials of two modes under random forces, identified from displacements alone.

Frequencies, damping, shapes, duration and sampling rate are drawn. The decays of the modes are
assessed, also against the Cramér-Rao bound.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from galloping.line.galerkin import STATES
from galloping.model.intervals import decay_interval
from galloping.model.modes import Modes
from galloping.recording.samples import Recording
from galloping.streams import make_generator
from galloping.trials.attempts import identify_once
from galloping.trials.real_lines import NOISE_LEVEL, TERMS, start_row

FREQUENCIES, DAMPING = (0.4, 1.0), (0.003, 0.02)  # Hz; damping ratio
DURATIONS, RATES = (300.0, 1200.0), (5.0, 25.0)  # s, Hz
MAX_MODE_MIXING = 0.3  # motion of the other coordinate in a mode, relative to its own coordinate
MIN_FREQUENCY_RATIO = 1.15  # larger over smaller frequency of the two modes
# (equation, terms) of the unknown coefficients
FREE_COEFFICIENTS = tuple((i, np.array([j])) for i in (2, 3) for j in range(4))


@dataclass(frozen=True)
class RandomMotion:
    """Simulated motion of two modes under random forces, with its noisy recording.

    It is the process dx = system x dt + white forces, x of STATES; displacements are sampled with
    noise. system, forces: (4, 4), forces the covariance per second. noise: (2,) standard deviations
    of white noise.
    """

    system: np.ndarray
    forces: np.ndarray
    noise: np.ndarray
    recording: Recording

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "RandomMotion":
        """Sample two random modes, and simulate and record their motion under random forces.

        The modes have similar standard deviations, within the ranges above.
        """
        omega = np.ones(2)
        while omega.max() < MIN_FREQUENCY_RATIO * omega.min():
            omega = 2.0 * np.pi * rng.uniform(*FREQUENCIES, 2)
        damping, shapes = rng.uniform(*DAMPING, 2), np.eye(2)
        shapes[[0, 1], [1, 0]] = rng.uniform(-MAX_MODE_MIXING, MAX_MODE_MIXING, 2)
        duration, rate = rng.uniform(*DURATIONS), rng.uniform(*RATES)
        inverse, system, forces = np.linalg.inv(shapes), np.eye(4, k=2), np.zeros((4, 4))
        system[2:, :2] = -shapes * omega**2 @ inverse
        system[2:, 2:] = -shapes * (2.0 * damping * omega) @ inverse
        root = shapes * np.sqrt(4.0 * damping * omega**3)  # so that modes have equal variances
        forces[2:, 2:] = root @ root.T
        stationary, step, process_noise = _discretise_process(system, forces, 1.0 / rate)
        root = np.linalg.cholesky(process_noise)
        states = np.empty((round(duration * rate), 4))
        states[0] = np.linalg.cholesky(stationary) @ rng.standard_normal(4)
        for k in range(1, len(states)):
            states[k] = step @ states[k - 1] + root @ rng.standard_normal(4)
        noise = NOISE_LEVEL * states.std(axis=0)
        values = states + noise * rng.standard_normal(states.shape)
        values[:, 2:] = np.nan
        recording = Recording(np.arange(len(states)) / rate, STATES, values)
        return cls(system, forces, noise[:2], recording)

    def compute_bound(self) -> np.ndarray:
        """Compute the Cramér-Rao standard deviation of each mode's decay rate, 1/s.

        Returns (2,). It is by P. Whittle's likelihood (Ark. Mat. 2, 1953), for unknown
        coefficients, forces and noise.
        """
        step = self.recording.time[1] - self.recording.time[0]
        frequencies = np.arange(1, len(self.recording.time) // 2) / len(self.recording.time)
        shift = np.exp(2j * np.pi * frequencies)[:, np.newaxis, np.newaxis] * np.eye(4)

        def spectrum(parameters: np.ndarray) -> np.ndarray:
            system, forces = self.system.copy(), np.zeros((4, 4))
            system[2:] = parameters[:8].reshape(2, 4)
            forces[2:, 2:] = parameters[[8, 9, 9, 10]].reshape(2, 2)
            _, transition, process_noise = _discretise_process(system, forces, step)
            response = np.linalg.inv(shift - transition)[:, :2]
            motion = response @ process_noise @ response.conj().swapaxes(1, 2)
            return motion + np.diag(parameters[11:])

        forces, noise = self.forces[2:, 2:], self.noise**2
        true = np.r_[self.system[2:].ravel(), forces[0], forces[1, 1], noise]
        steps = np.diag(np.r_[np.full(8, 1e-5), np.full(3, forces.max()), noise])  # last linear
        inverse = np.linalg.inv(spectrum(true))
        slopes = [
            inverse @ (spectrum(true + h) - spectrum(true - h)) / (2.0 * h.sum()) for h in steps
        ]
        information = np.einsum("afij,bfji->ab", slopes, slopes).real
        covariance = np.linalg.inv(information)[:8, :8]
        _, gradients = compute_decays(self.system, FREE_COEFFICIENTS)
        return np.sqrt(np.einsum("mi,ij,mj->m", gradients, covariance, gradients))


def _discretise_process(
    system: np.ndarray, forces: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute stationary covariance, transition over `step` s, and its covariance by forces."""
    stationary, transition = solve_continuous_lyapunov(system, -forces), expm(system * step)
    return stationary, transition, stationary - transition @ stationary @ transition.T


def trial(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """Identify simulated motions under random forces; yield a row of errors for each fit.

    There is a fit for each replicate and method, with the columns of `real_lines.trial`. The slower
    mode is the vertical one. coverage: of the decays of both modes; nothing is assessed if the
    model has no random forces. Seconds are those of the processor.
    """
    for replicate in replicates:
        motion = RandomMotion.draw(make_generator(seed, "ambient", case, replicate))
        (true, _), bound = compute_decays(motion.system, ()), motion.compute_bound()
        for method, settings in methods.items():
            name = ("ambient", case, str(replicate))
            identified, answer = identify_once({method: settings}, [motion.recording], TERMS, name)
            row = start_row(case, "displacements", replicate, seed, answer)
            if identified.is_forced:
                places = np.argwhere(identified.support)
                exponents: np.ndarray = np.array(identified.model.terms)[places[:, 1]]
                entries = list(zip(places[:, 0], map(np.flatnonzero, exponents), strict=True))
                estimated, slopes = compute_decays(
                    identified.model.jacobian(np.zeros((1, 4)))[0], entries
                )
                errors = np.sqrt(np.einsum("mi,ij,mj->m", slopes, identified.covariance, slopes))
                duration, is_covered = float(identified.diagnostics["duration"]), []
                row["terms"] = len(places)
                for k, direction in enumerate("vw"):
                    low, high = decay_interval(-estimated[k].real, errors[k], duration)
                    is_covered.append(low <= -true[k].real <= high)
                    row[f"damping_{direction}_bound_percent"] = -100.0 * bound[k] / true[k].real
                    for quantity, part in (("damping", np.real), ("frequency", np.imag)):
                        error = 100.0 * (part(estimated[k]) / part(true[k]) - 1.0)
                        row[f"{quantity}_{direction}_error_percent"] = float(error)
                row["coverage"] = float(np.mean(is_covered))
            yield row


def compute_decays(
    system: np.ndarray, places: Sequence[tuple[int, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the eigenvalues of a linear system's modes, and derivatives of their decay rates.

    Returns the eigenvalues, 1/s, by frequency, and the derivatives, (n_modes, n_places), by
    coefficients of the system. places: equation and state of each coefficient, none for a constant.
    """
    modes = Modes.of(system)
    left_modes, oscillating = np.linalg.inv(modes.shapes), modes.oscillating
    slopes = [
        [-(left_modes[m, i] * modes.shapes[j, m].sum()).real for i, j in places]
        for m in oscillating
    ]
    return modes.values[oscillating], np.array(slopes)
