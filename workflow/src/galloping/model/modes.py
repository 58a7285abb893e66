"""The modes of a linear system dx/dt = A x, such as the small motions of a model at rest.

A room of its own: polynomial models, the continuous line and random forces share nothing else.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray


class Modes(NamedTuple):
    """values: (n,) eigenvalues, real part growth, 1/s, and imaginary part frequency, rad/s. shapes:
    (n_states, n) eigenvectors, in columns.
    """

    values: NDArray[np.complex128]
    shapes: NDArray[np.complex128]

    @classmethod
    def of(cls, system: NDArray[np.float64]) -> Self:
        """All modes of A (n_states, n_states), oscillations as conjugate pairs."""
        return cls(*np.linalg.eig(system))

    @property
    def omega(self) -> NDArray[np.float64]:
        """(n,) natural frequencies, rad/s."""
        return np.abs(self.values)

    @property
    def damping(self) -> NDArray[np.float64]:
        """(n,) ratios to critical, below zero of modes that grow."""
        return -self.values.real / self.omega

    @property
    def stable(self) -> bool:
        """Whether all die out."""
        return bool(np.all(self.values.real < 0))

    @property
    def oscillating(self) -> NDArray[np.intp]:
        """Indices of the oscillations, by frequency, one of each conjugate pair."""
        places = np.flatnonzero(self.values.imag > 0)
        return places[np.argsort(self.values.imag[places])]

    def oscillations(self) -> Self:
        """The oscillations alone, by frequency, one of each conjugate pair."""
        own = self.oscillating
        return type(self)(self.values[own], self.shapes[:, own])

    def critical(self) -> tuple[float, NDArray[np.complex128]]:
        """Frequency, rad/s, and shape (n_states,) of the oscillation closest to the imaginary axis.

        Raises ValueError where there is none.
        """
        nearest = min(self.oscillating, key=lambda k: abs(self.values[k].real))
        return float(self.values[nearest].imag), self.shapes[:, nearest]
