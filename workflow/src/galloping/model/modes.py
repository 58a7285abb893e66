"""Modes of a linear system dx/dt = A x, such as small motions of a model about an equilibrium.

This module is separate, since polynomial models, the continuous line and random forces share
nothing else.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray


class Modes(NamedTuple):
    """Eigenvalues and eigenvectors of a linear system dx/dt = A x.

    values: (n,), real part growth, 1/s, and imaginary part frequency, rad/s. shapes: (n_states, n),
    in columns.
    """

    values: NDArray[np.complex128]
    shapes: NDArray[np.complex128]

    @classmethod
    def of(cls, system: NDArray[np.float64]) -> Self:
        """Compute all eigenvalues and eigenvectors of the system matrix A.

        system: (n_states, n_states). Oscillations are conjugate pairs.
        """
        return cls(*np.linalg.eig(system))

    @property
    def omega(self) -> NDArray[np.float64]:
        """Natural frequencies of the n modes, (n,), rad/s."""
        return np.abs(self.values)

    @property
    def damping(self) -> NDArray[np.float64]:
        """Damping ratios of the n modes, (n,), negative for modes that grow."""
        return -self.values.real / self.omega

    @property
    def oscillating(self) -> NDArray[np.intp]:
        """Indices of the oscillating modes in order of frequency, one per conjugate pair."""
        places = np.flatnonzero(self.values.imag > 0)
        return places[np.argsort(self.values.imag[places])]

    def oscillations(self) -> Self:
        """Return the oscillating modes in order of frequency, one per conjugate pair."""
        own = self.oscillating
        return type(self)(self.values[own], self.shapes[:, own])

    def critical(self) -> tuple[float, NDArray[np.complex128]]:
        """Return frequency (rad/s) and shape of the oscillating mode nearest the imaginary axis.

        The shape is (n_states,). Raises ValueError if no mode oscillates.
        """
        nearest = min(self.oscillating, key=lambda k: abs(self.values[k].real))
        return float(self.values[nearest].imag), self.shapes[:, nearest]
