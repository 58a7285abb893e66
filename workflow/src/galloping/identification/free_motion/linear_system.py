"""Linear system with given modes: its stiffness and damping, with their covariance.

As many modes as coordinates, with their shapes in the channels, determine the equations of all
velocities: dx/dt = A x has the modes as eigenvectors.
"""

from collections.abc import Sequence

import numpy as np

from galloping.identification.free_motion.damped_modes import DampedModes, Stretch
from galloping.identification.random_forces.channels import Channels

STEP = 1e-3  # step of finite differences, in standard errors


def linear_system_with_covariance(
    channels: Channels,
    stretches: Sequence[Stretch],
    modes: DampedModes,
    own: Sequence[int],
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the matrix of the linear system with fitted modes, and its covariance.

    own: places of n_coordinates modes. Returns the matrix, (n_states, n_states), and the covariance
    of its entries, row by row, (n_states^2, n_states^2).
    """
    places = list(own)
    index = int(np.argmax([np.linalg.norm(each[places]) for each in modes.amplitudes]))
    covariance = modes.amplitude_covariance(stretches[index], index, places)
    n, many = len(places), modes.amplitudes[index].shape[1]

    def system(parameters: np.ndarray) -> np.ndarray:
        growths, frequencies, *parts = np.split(parameters, [n, 2 * n, n * (2 + many)])
        shapes = (parts[0] + 1j * parts[1]).reshape(n, many).T
        return channels.system_with_modes(growths + 1j * frequencies, shapes)

    amplitudes = modes.amplitudes[index][places].ravel()
    poles = modes.poles[places]
    best = np.concatenate([poles.real, poles.imag, amplitudes.real, amplitudes.imag])
    errors = np.sqrt(np.diag(covariance))
    slopes = np.zeros((len(best), 4 * n * n))
    for k in np.flatnonzero(errors > 0.0):
        step = np.zeros(len(best))
        step[k] = STEP * errors[k]
        change = system(best + step) - system(best - step)
        slopes[k] = change.ravel() / (2.0 * step[k])
    return system(best), slopes.T @ covariance @ slopes
