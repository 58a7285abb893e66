"""Motion of modes in forces, made without the code under test."""

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov
from scipy.signal import lfilter

from galloping import Recording

STATES = ("q_v", "q_w", "dq_v", "dq_w")
FREQUENCIES, DAMPING = np.array([0.5, 0.8]), np.array([0.012, 0.008])


def two_modes(
    seed=1, *, duration=600.0, rate=10.0, noise=0.05, shapes=((1, 0), (0, 1)), strength=0.01
):
    """A recording of displacements, its true states and the true matrix of its equations."""
    rng = np.random.default_rng(seed)
    omega, shapes = 2 * np.pi * FREQUENCIES, np.array(shapes, float)
    inverse, system = np.linalg.inv(shapes), np.zeros((4, 4))
    system[:2, 2:] = np.eye(2)
    system[2:, :2] = -shapes @ np.diag(omega**2) @ inverse
    system[2:, 2:] = -shapes @ np.diag(2 * DAMPING * omega) @ inverse
    forces = np.zeros((4, 4))
    forces[2:, 2:] = strength**2 * shapes @ shapes.T
    stationary = solve_continuous_lyapunov(system, -forces)
    transition = expm(system / rate)
    disturbance = stationary - transition @ stationary @ transition.T
    root = np.linalg.cholesky((disturbance + disturbance.T) / 2)
    count = round(duration * rate)
    states = np.empty((count, 4))
    states[0] = np.linalg.cholesky(stationary) @ rng.standard_normal(4)
    for k in range(1, count):
        states[k] = transition @ states[k - 1] + root @ rng.standard_normal(4)
    values = states + noise * states.std(axis=0) * rng.standard_normal(states.shape)
    return displacements(np.arange(count) / rate, *values[:, :2].T), states, system


def stepped(acceleration, forces, step, position=0.0):
    """Positions and velocities, each (n, ...), from rest at a position, at the first of each row of
    `forces` (n, steps, ...): in steps that are short beside what the samples show.
    """
    x, v, seen = position, 0.0 * position, []
    for row in forces:
        seen.append((x, v))
        for now in row:
            v = v + step * acceleration(x, v, now)
            x = x + step * v
    return np.moveaxis(seen, 1, 0)


def displacements(time: np.ndarray, *channels: np.ndarray, noise=0.0, seed=0) -> Recording:
    """A recording of one coordinate or two, with white noise of a deviation, and of no velocity."""
    values = np.full((len(time), 2 * len(channels)), np.nan)
    drawn = np.random.default_rng(seed).standard_normal((len(time), len(channels)))
    values[:, : len(channels)] = np.transpose(channels) + noise * drawn
    return Recording(time, ("q_v", "dq_v") if len(channels) == 1 else STATES, values)


def swing(time: np.ndarray, frequency: float, damping: float, seed: int) -> np.ndarray:
    """One mode, Hz and ratio, of deviation one, at equal steps."""
    omega, step = 2 * np.pi * frequency, time[1] - time[0]
    turn = omega * np.sqrt(1 - damping**2) * step
    poles = [1.0, -2 * np.exp(-damping * omega * step) * np.cos(turn)]
    poles.append(np.exp(-2 * damping * omega * step))
    force = np.random.default_rng(seed).standard_normal(len(time) + 20_000)
    motion = lfilter([1.0], poles, force)[-len(time) :]
    return motion / motion.std()
