"""State-space model in white forces: filter of recordings, and simulation from their end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import IdentificationError
from galloping.identification.oscillations import Resonance
from galloping.identification.preparation.channels import Channels
from galloping.identification.random_forces.kalman import (
    extended_filter,
    kalman_filter,
    random_motion,
    tabulate_monomial_derivatives,
)
from galloping.identification.random_forces.steps import Steps, append_mean_rates, discretise
from galloping.identification.work import count_work, work_limit
from galloping.model.intervals import covariance_root
from galloping.model.modes import Modes
from galloping.model.polynomial import PolynomialModel, exponent_matrix
from galloping.recording.samples import Recording
from galloping.trajectory.right_hand_side import Tables, make_tables

# Standard deviation of the first state of a linear system, relative to the motion. Samples outweigh
# it by 1e6 in squares, and ten of the sixteen digits of a covariance are left.
DIFFUSE_DEVIATION = 1e3
# Standard deviation of the first state of a nonlinear system, which is linearised at its expected
# state, relative to the motion.
NONLINEAR_DEVIATION = 3.0
# Number of integration steps of a nonlinear system in its shortest period. With the method of
# fourth order, a frequency then errs by 2e-4 of itself, and a damping ratio by 6e-5.
SUBSTEPS_PER_PERIOD = 16
# Most integration steps between samples. Samples show nothing of quicker motion.
MAX_SUBSTEPS = 64


@dataclass(frozen=True)
class SampledChannels:
    """Samples of the channels of a recording, NaN where missing, and their time steps.

    samples: (n, n_channels).
    """

    samples: np.ndarray
    steps: Steps

    @classmethod
    def from_recording(cls, recording: Recording, channels: Channels) -> "SampledChannels":
        """Extract the samples of given channels, and their time steps, from a recording."""
        steps = Steps.from_times(recording.time, tuple(recording.inputs.values()))
        return cls(channels.samples(recording), steps)


@dataclass(frozen=True)
class FilterResult:
    """Result of a Kalman filter over a recording: innovations and estimates of the states.

    innovations, variances: (n, n_channels) of samples, NaN where missing. means: (n, n_states)
    after each. mean, covariance: of the states, and of slow forces, after the last. count: of the
    samples, more than of the finite innovations if the filter fails.
    """

    innovations: np.ndarray
    variances: np.ndarray
    means: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    count: int

    @property
    def standardised(self) -> np.ndarray:
        """Innovations divided by their standard deviations, (n_samples, n_channels)."""
        return self.innovations / np.sqrt(self.variances)


@dataclass(frozen=True)
class Forces:
    """Random forces in the equations of a model: white, slowly varying and oscillating.

    white: (n_states, n_states) covariance per second of white forces in the equations. slow:
    (n_states, n_states) of the drive of forces that decay at `rates` (n_states,), 1/s, as those of
    gusts do; zero if there are none. resonances: forces that oscillate.
    """

    white: np.ndarray
    slow: np.ndarray
    rates: np.ndarray
    resonances: tuple[Resonance, ...] = ()

    @cached_property
    def slow_equations(self) -> np.ndarray:
        """Indices of the equations with a slowly varying force, (n_slow,)."""
        return np.flatnonzero(np.diag(self.slow))

    @classmethod
    def from_model(cls, identified: IdentifiedModel) -> "Forces":
        """Extract the random forces of an identified model."""
        rates = [identified.diagnostics.get(f"slow_rate_{s}", 1.0) for s in identified.model.states]
        return cls(
            identified.forces, identified.slow_forces, np.array(rates), identified.resonances
        )

    def density(self, omega: float) -> np.ndarray:
        """Compute the two-sided spectral density of the forces at a frequency in rad/s.

        Returns (n_states, n_states): as of white forces with the same effect on a mode there.
        """
        return self.white + self.slow / (self.rates**2 + omega**2)


@dataclass(frozen=True)
class StateSpaceModel:
    """Equations of motion with random forces and sensor noise, as used by the Kalman filter.

    noise: (n_channels,) deviations of a sample. size: (n_states,) of the motion. input_means: those
    at which the linear part is computed. With slow forces, the filter includes these.
    Raises IdentificationError if the model has no equilibrium.
    """

    model: PolynomialModel
    forces: Forces
    channels: Channels
    noise: np.ndarray
    size: np.ndarray
    input_means: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def steady(self) -> PolynomialModel:
        """The equations of motion with all inputs fixed at their means."""
        return self.model.at(self.input_means)

    @cached_property
    def system(self) -> np.ndarray:
        """Matrix of the linear part of the equations, (n_states, n_states)."""
        return self.steady.jacobian(np.zeros((1, len(self.size))))[0]

    @cached_property
    def modes(self) -> Modes:
        """Modes of the linear part of the equations."""
        return self.steady.small_motions(np.zeros(len(self.size)))

    @cached_property
    def equilibrium(self) -> np.ndarray:
        """Equilibrium of the linear part of the equations, (n_states,)."""
        if np.linalg.det(self.system) == 0.0:
            raise IdentificationError(Code.STIFFNESS_UNDETERMINED)
        return -np.linalg.solve(self.system, self.steady(np.zeros((1, len(self.size))))[0])

    @cached_property
    def augmented_system(self) -> tuple[np.ndarray, np.ndarray]:
        """Linear system matrix with slow and oscillating forces as states, and force covariance.

        Both are (m, m); the covariance per second is that of the white forces.
        """
        n, places = len(self.equilibrium), self.forces.slow_equations
        p, r = n + len(places), len(self.forces.resonances)
        m = p + 2 * r
        system, white = np.zeros((m, m)), np.zeros((m, m))
        system[:n, :n], white[:n, :n] = self.system, self.forces.white
        system[places, np.arange(n, p)] = 1.0
        system[n:p, n:p] = -np.diag(self.forces.rates[places])
        white[n:p, n:p] = self.forces.slow[np.ix_(places, places)]
        driven = [*range(n), *range(p + r, m)]
        for k, one in enumerate(self.forces.resonances):
            force, rate = p + k, p + r + k
            system[:n, force], system[force, rate] = one.onto, 1.0
            system[rate, force] = -np.square(one.frequency)  # infinite after too long a step
            system[rate, rate] = -2.0 * one.damping * one.frequency
            white[rate, driven] = white[driven, rate] = one.drive
        return system, white

    @cached_property
    def is_linear(self) -> bool:
        """Whether the equations are linear and independent of inputs."""
        n, exponents = len(self.size), exponent_matrix(self.model.terms, len(self.model.names))
        others = (exponents[:, :n].sum(axis=1) > 1) | exponents[:, n:].any(axis=1)
        return not self.model.coefficients[:, others].any()

    @property
    def first_mean(self) -> np.ndarray:
        """Mean of the states of `augmented_system` before the first sample, (m,)."""
        return np.pad(self.equilibrium, (0, len(self.augmented_system[0]) - len(self.size)))

    @property
    def first_covariance(self) -> np.ndarray:
        """Covariance of the states of `augmented_system` before the first sample, (m, m)."""
        slow = np.diag(self.forces.slow) / (2.0 * self.forces.rates)
        within = (DIFFUSE_DEVIATION if self.is_linear else NONLINEAR_DEVIATION) * self.size
        p, resonances = len(self.size) + len(self.forces.slow_equations), self.forces.resonances
        decay = np.array([2.0 * each.damping * each.frequency for each in resonances])
        of_rates = np.diag(self.augmented_system[1])[p + len(resonances) :] / (2.0 * decay)
        of_forces = of_rates / np.array([each.frequency**2 for each in resonances])
        variances = [within**2, slow[self.forces.slow_equations], of_forces, of_rates]
        return np.diag(np.concatenate(variances))

    @property
    def _tables(self) -> Tables:
        return make_tables(self.model.terms, len(self.size))

    def equations(self, terms: Sequence[int] | np.ndarray = ()) -> tuple[np.ndarray, np.ndarray]:
        """Return the polynomial equations as exponents of monomials and their coefficients.

        Shapes (n_terms, m + n_factors) and (m, n_terms). The equations are those of the states and
        slow forces, and have the terms of the model that are present, after `terms`, indices that
        come first.
        """
        n, m, tables = len(self.size), len(self.augmented_system[0]), self._tables
        others = np.flatnonzero(self.model.coefficients.any(axis=0))
        present = np.array([*terms, *(j for j in others if j not in set(terms))], np.int64)
        signals, count = tables.exponents[tables.position[present]], len(present)
        exponents = np.zeros((count + m - n, m + len(tables.factors)), np.int64)
        exponents[:count, :n], exponents[:count, m:] = signals[:, :n], signals[:, n:]
        exponents[count:, n:m] = np.eye(m - n, dtype=np.int64)
        coefficients = np.zeros((m, len(exponents)))
        coefficients[:n, :count] = self.model.coefficients[:, present]
        coefficients[:, count:] = self.augmented_system[0][:, n:]
        return exponents, coefficients

    def substeps(self, lengths: np.ndarray) -> np.ndarray:
        """Compute how many integration substeps time steps of given lengths (n_steps,), s, need."""
        fastest = self.modes.omega.max()
        return np.ceil(lengths * fastest * SUBSTEPS_PER_PERIOD / (2.0 * np.pi)).astype(np.int64)

    def filter_extended(
        self, data: SampledChannels, candidates: np.ndarray, terms: Sequence[int] | np.ndarray = ()
    ) -> tuple[FilterResult, np.ndarray]:
        """Run the extended Kalman filter, with derivatives of the innovations by coefficients.

        The arguments are as of `extended_filter`. candidates: (n_candidates, 2), of equations and
        of `terms`. Raises IdentificationError if a pass takes more than all the work of a search,
        or if the system is much faster than its samples.
        """
        m, lagged = len(self.augmented_system[0]), np.array(self.channels.lagged, int)
        given = self.first_mean, self.first_covariance, self.augmented_system[1]
        x, p, white = (np.pad(each, (0, len(lagged))) for each in given)
        exponents, coefficients = self.equations(terms)
        exponents = np.insert(exponents, np.full(len(lagged), m), 0, axis=1)
        coefficients = np.pad(coefficients, ((0, len(lagged)), (0, 0)))
        innovations, variances, means, slopes = self._run_extended_filter(
            data, exponents, coefficients, white, x, p, candidates, lagged
        )
        return self._make_result(data, innovations, variances, means, x, p), slopes

    def _make_result(
        self, data: SampledChannels, innovations, variances, means, x, p
    ) -> FilterResult:
        """Assemble the result of a compiled filter; x, p: mean and covariance at its end."""
        n, m = len(self.size), len(self.augmented_system[0])
        count = int(np.isfinite(data.samples).sum())
        return FilterResult(innovations, variances, means[:, :n], x[:m], p[:m, :m], count)

    def _run_extended_filter(
        self, data: SampledChannels, exponents, coefficients, white, x, p, candidates, lagged
    ):
        channels, steps = self.channels, data.steps
        counts = self.substeps(steps.lengths)
        of_substep = 8e-7 + 1.2e-8 * exponents.size + 4e-9 * len(candidates) * len(x) ** 2
        seconds = counts[steps.index].sum() * of_substep
        quick = np.median(counts[steps.index]) > MAX_SUBSTEPS
        if quick or seconds > work_limit(len(data.samples)):
            raise IdentificationError(Code.MOTION_TOO_QUICK)
        count_work(seconds)
        return extended_filter(
            data.samples, steps.index, steps.lengths, counts,
            steps.input_factors(counts, self._tables.factors), exponents,
            tabulate_monomial_derivatives(exponents, len(x)), coefficients, white,
            channels.observed, channels.is_rate, lagged, self.noise**2, x, p, candidates,
        )  # fmt: skip

    def simulate(self, x: np.ndarray, steps: Steps, rng: np.random.Generator) -> np.ndarray:
        """Simulate the states under random forces from given initial values.

        x: (m,) initial states and slow forces. Returns (n, n_states).
        """
        counts = self.substeps(steps.lengths)
        noise = rng.standard_normal((counts[steps.index[1:]].sum(), len(x)))
        states = random_motion(
            x, steps.index[1:], steps.lengths, counts,
            steps.input_factors(counts, self._tables.factors), *self.equations(),
            covariance_root(self.augmented_system[1]), noise,
        )  # fmt: skip
        return states[:, : len(self.size)]

    def filter(self, data: SampledChannels) -> FilterResult:
        """Run the Kalman filter, extended if the equations are nonlinear, over a recording.

        Raises IdentificationError if the filter fails.
        """
        if not self.is_linear:
            return self.filter_extended(data, np.zeros((0, 2), np.int64))[0]
        (system, white), lengths = self.augmented_system, data.steps.lengths
        transitions, disturbances = discretise(system, white, lengths)
        values, lagged = list(self.channels.values), list(self.channels.lagged)
        sensing = self.channels.sensing(system)
        offsets = np.append(self.equilibrium[values], np.zeros(len(self.channels.rates)))
        if lagged:
            transitions, disturbances = append_mean_rates(
                transitions, disturbances, lengths, lagged
            )
            m = len(system)
            sensing = np.eye(m + len(lagged))[[*values, *range(m, m + len(lagged))]]
        p, n = np.pad(self.first_covariance, (0, len(lagged))), len(self.equilibrium)
        x = np.zeros(len(p))
        count_work(3e-4 + 6e-8 * len(data.samples) * len(p))
        innovations, variances, means = kalman_filter(
            data.samples - offsets, data.steps.index, transitions, disturbances, sensing,
            self.noise**2, x, p,
        )  # fmt: skip
        x[:n] += self.equilibrium
        means[:, :n] += self.equilibrium
        return self._make_result(data, innovations, variances, means, x, p)

    def first_state(self, data: SampledChannels, count: int) -> np.ndarray:
        """Estimate the states at the first sample from the first `count` samples.

        Returns (n_states,). The filter is of the states together with their first values, which are
        constant, and of rates at the sample, which mean rates approximate except for the forces in
        them.
        """
        if self.channels.averaged:
            white = np.diag(self.augmented_system[1])[list(self.channels.rates)]
            of_force = np.sqrt(white / data.steps.lengths.min())
            noise = np.hypot(self.noise, np.pad(of_force, (len(self.channels.values), 0)))
            other = replace(self, channels=replace(self.channels, averaged=False), noise=noise)
            return other.first_state(data, count)
        exponents, coefficients = self.equations()
        m, n, steps = len(coefficients), len(self.size), data.steps
        states, factors = exponents[:, :m], exponents[:, m:]
        doubled = np.zeros((2 * m, 2 * m))
        doubled[:m, :m] = self.augmented_system[1]
        x, p = np.tile(self.first_mean, 2), np.kron(np.ones((2, 2)), self.first_covariance)
        steps = replace(steps, index=steps.index[:count], time=steps.time[:count])
        self._run_extended_filter(
            SampledChannels(data.samples[:count], steps),
            np.hstack([states, np.zeros_like(states), factors]),
            np.vstack([coefficients, np.zeros_like(coefficients)]), doubled, x, p,
            np.zeros((0, 2), np.int64), np.zeros(0, np.int64),
        )  # fmt: skip
        return x[m : m + n]


def motion_sizes(
    recordings: list[Recording], channels: Channels, period: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute standard deviations of the states, and means and deviations of the channels.

    Those of the states, (n_states,), follow from the channels for a motion of given period, s.
    """
    together = np.concatenate([channels.samples(each) for each in recordings])
    mean, deviation = np.nanmean(together, axis=0), np.nanstd(together, axis=0)
    omega, size = 2.0 * np.pi / period, np.ones(len(channels.states))
    for i, velocity in channels.pairs.items():
        displacement = channels.displacement(i, np.array([1j * omega]), deviation[:, np.newaxis])
        size[i] = np.abs(displacement[0])
        size[velocity] = omega * size[i]
    return size, mean, deviation
