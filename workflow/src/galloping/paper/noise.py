"""What noise makes of the paper's regression: inner products, drawn without 30,001 samples.

Where states are exact, the noise of the derivatives enters least squares only through its
projections on the library's columns: 35 normal numbers for each equation, which are drawn as such.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from galloping.identification.sparse.regression import Regression
from galloping.measurement.measuring import Motion
from galloping.polynomial import Exponents, design_matrix


@dataclass(frozen=True)
class Products:
    """All that least squares sees of k recordings of one motion.

    lengths: (p,) of the library's columns, which are divided by them, so that fewest digits are
    lost. grams: (k, p, p), moments: (k, m, p), inner products of these columns and of them with
    the m derivatives. across: (k, m), what no combination of the columns explains of a derivative.
    samples: of each recording.
    """

    lengths: np.ndarray
    grams: np.ndarray
    moments: np.ndarray
    across: np.ndarray
    samples: int

    def regressions(self, names: tuple[str, ...], terms: tuple[Exponents, ...]) -> list[Regression]:
        """Each recording as the regression that its samples would be reduced to."""
        m, p = self.moments.shape[1:]
        reduced = []
        for gram, moments, across in zip(self.grams, self.moments, self.across, strict=True):
            triangle = np.linalg.cholesky(gram).T
            library = np.vstack([triangle, np.zeros((m, p))]) * self.lengths
            targets = np.vstack([np.linalg.solve(triangle.T, moments.T), np.diag(across)])
            observations = np.full(m, self.samples)
            reduced.append(Regression(library, targets, observations, names, terms))
        return reduced


@dataclass(frozen=True)
class DerivativeNoise:
    """Exact states with noisy derivatives.

    terms: of the candidate library. unit: (n_states,), what a noise level is in units of.
    """

    motion: Motion
    terms: tuple[Exponents, ...]
    unit: np.ndarray

    def draw(self, level: float, points: int, rng: np.random.Generator, draws: int = 1) -> Products:
        """Recordings of the same `points` samples, all or at random, with noise at `level`."""
        n, p = self._theta.shape
        gram, moments = self._whole
        if points < n:
            kept = np.zeros(n, bool)
            kept[rng.choice(n, size=points, replace=False)] = True
            if points <= n / 2:
                gram, moments = self._products(kept)
            else:
                gram, moments = (
                    a - b for a, b in zip(self._whole, self._products(~kept), strict=True)
                )
        sigma = level * self.unit
        shape = draws, len(sigma), p
        noise = rng.standard_normal(shape) @ np.linalg.cholesky(gram).T
        across = sigma * np.sqrt(rng.chisquare(points - p, size=shape[:2]))
        moments = moments.T + sigma[:, np.newaxis] * noise
        return Products(
            self._lengths, np.broadcast_to(gram, (draws, p, p)), moments, across, points
        )

    @cached_property
    def _lengths(self) -> np.ndarray:
        return np.linalg.norm(design_matrix(self.motion.states, self.terms), axis=0)

    @cached_property
    def _theta(self) -> np.ndarray:
        theta = design_matrix(self.motion.states, self.terms) / self._lengths
        return np.ascontiguousarray(theta)

    @cached_property
    def _whole(self) -> tuple[np.ndarray, np.ndarray]:
        return self._products(slice(None))

    def _products(self, rows: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        theta = self._theta[rows]
        return theta.T @ theta, theta.T @ self.motion.derivatives[rows]


@dataclass(frozen=True)
class VelocityNoise:
    """Noisy velocities beside exact displacements, derivatives by central differences of both.

    This is what the paper's sentence says word by word: noise is added to the velocities, and the
    left side is the numerical derivative of the states. Fields as of `DerivativeNoise`.
    """

    motion: Motion
    terms: tuple[Exponents, ...]
    unit: np.ndarray

    def draw(self, level: float, points: int, rng: np.random.Generator, draws: int = 1) -> Products:
        """Recordings of `points` samples each, all or at random, with noise at `level`."""
        parts = [self._draw(level, points, rng) for _ in range(draws)]
        lengths = np.linalg.norm(design_matrix(self.motion.states, self.terms), axis=0)
        grams, moments, squares = (np.stack(each) for each in zip(*parts, strict=True))
        grams, moments = grams / lengths / lengths[:, np.newaxis], moments / lengths
        explained = np.sum(
            np.linalg.solve(grams, moments.swapaxes(1, 2)).swapaxes(1, 2) * moments, axis=2
        )
        across = np.sqrt(np.maximum(squares - explained, 0))
        return Products(lengths, grams, moments, across, points)

    def _draw(
        self, level: float, points: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        motion, n = self.motion, len(self.motion.time)
        velocities = len(motion.names) // 2
        states = motion.states.copy()
        noise = rng.standard_normal(states[:, velocities:].shape)
        states[:, velocities:] += level * self.unit[velocities:] * noise
        derivatives = np.gradient(states, motion.time, axis=0, edge_order=2)
        rows = slice(None) if points >= n else rng.choice(n, size=points, replace=False)
        theta, derivatives = design_matrix(states[rows], self.terms), derivatives[rows]
        return theta.T @ theta, derivatives.T @ theta, np.sum(derivatives**2, axis=0)


# by name: how noise comes into the regression, and which of `channel_scale` a level is in units of
PROTOCOLS = {"derivative": (DerivativeNoise, 1), "velocity": (VelocityNoise, 0)}
