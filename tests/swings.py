"""Free motion of oscillators with events, made without the code under test."""

import numpy as np

from galloping import Recording

STATES = ("q", "dq")


def pole(hertz, damping):
    """Growth and frequency, 1/s, of a mode with a natural frequency and a damping ratio."""
    omega = 2.0 * np.pi * hertz
    return omega * complex(-damping, np.sqrt(1.0 - damping**2))


def swing(time, hertz, damping, amplitude=1.0, derivative=0):
    """Displacement at `time`, s, or its derivative, of a mode that begins at time zero at rest
    before it.
    """
    own = pole(hertz, damping)
    moved = amplitude * own**derivative * np.exp(own * np.maximum(time, 0.0))
    return np.where(time >= 0.0, moved.real, 0.0)


def sensed(time, samples, derivative=0):
    """A recording of a displacement, or of an acceleration by an accelerometer."""
    values, rates = np.full((2, len(time), 2), np.nan)
    if derivative == 0:
        values[:, 0] = samples
        return Recording(time, STATES, values)
    rates[:, 1] = samples
    offsets = np.array([False, True])
    return Recording(time, STATES, values, rates=rates, unknown_offsets=offsets)


def noisy(samples, seed, level=0.01):
    """Samples with white noise in units of the largest of them."""
    noise = np.random.default_rng(seed).standard_normal(len(samples))
    return samples + level * np.abs(samples).max() * noise


def small_motions(found):
    """Natural frequency, Hz, and damping ratio of a model of one coordinate."""
    stiffness, damping = found.model.jacobian(np.zeros((1, 2)))[0][1]
    omega = np.sqrt(-stiffness)
    return omega / (2.0 * np.pi), -damping / (2.0 * omega)
