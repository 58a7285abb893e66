"""Recordings of every kind of motion that is identified, and the same in other units."""

from dataclasses import replace

import field_files as files
import numpy as np
from ambient import two_modes
from integrators import moved
from scipy.interpolate import CubicSpline

from galloping import Recording
from galloping.model.polynomial import velocity_pairs
from galloping.recording.samples import Input

STATES = ("q", "dq")


def noisy(states, noise, seed, measured=(0,)):
    """(n, n_states) samples of the states that are measured, NaN of the others."""
    values = np.full(states.shape, np.nan)
    own, drawn = list(measured), np.random.default_rng(seed).standard_normal(states.shape)
    values[:, own] = (states + noise * drawn)[:, own]
    return values


def of_displacement(time, states, noise, seed=1, measured=(0,), **more):
    return Recording(time, STATES, noisy(states, noise, seed, measured), **more)


def rates_of_van_der_pol(t, x):
    """Damping of -10 % of critical, and a limit cycle of 2."""
    return [x[1], 0.2 * x[1] * (1 - x[0] ** 2) - x[0]]


def van_der_pol(duration, start, measured=(0,)):
    time = np.arange(round(20 * duration) + 1) / 20
    states = moved(rates_of_van_der_pol, start, time)
    return of_displacement(time, states, 0.02, measured=measured)


def growing():
    return van_der_pol(120.0, (0.1, 0.0))


def growing_with_its_velocity():
    return van_der_pol(120.0, (0.1, 0.0), measured=(0, 1))


def on_its_limit_cycle():
    whole = van_der_pol(150.0, (2.0, 0.0))
    return whole[1000:]


def decaying():
    time = np.arange(1501) / 25
    states = moved(
        lambda t, x: [x[1], -6.25 * x[0] - 0.08 * x[1] - 1.5 * x[0] ** 3 - 0.02 * x[1] ** 3],
        (1.0, 0.0), time,
    )  # fmt: skip
    return of_displacement(time, states, 0.01, seed=2)


def line():
    """The span of two modes, galloping after a release."""
    time, states = files.motion(12.0, 150.0)
    return Recording(time, files.STATES, noisy(states, files.NOISE, 1, (0, 1)))


def in_random_forces():
    return two_modes(duration=120.0)[0]


def driven():
    """By a wind that wanders."""
    time, knots = np.arange(4001) / 20, np.linspace(0, 200, 401)
    walk = np.cumsum(np.random.default_rng(3).standard_normal(401))
    wind = CubicSpline(knots, 5 + (walk - walk.mean()) / walk.std())
    states = moved(
        lambda t, x: [x[1], -4 * x[0] - 0.1 * x[1] - 0.5 * x[0] ** 3 + 0.3 * wind(t)],
        (0.0, 0.0), time,
    )  # fmt: skip
    inputs = {"U": Input(time, wind(time))}
    return of_displacement(time, states, 0.01, seed=4, inputs=inputs)


def with_an_accelerometer():
    """Beside the displacement; of another one alone, `of_accelerometers`."""
    own = van_der_pol(100.0, (0.3, 0.0))
    states = moved(rates_of_van_der_pol, (0.3, 0.0), own.time)
    rates = np.full(states.shape, np.nan)
    noise = 0.05 * np.random.default_rng(8).standard_normal(len(states))
    rates[:, 1] = rates_of_van_der_pol(0.0, states.T)[1] + noise
    return replace(own, rates=rates)


def of_accelerometers():
    time, states = files.motion(12.0, 150.0)
    rates, values = np.full((2, *states.shape), np.nan)
    true = files.line()(states)[:, 2:]
    drawn = np.random.default_rng(9).standard_normal(true.shape)
    rates[:, 2:] = true + 0.05 * true.std(axis=0) * drawn + (0.3, -0.2)
    unknown = np.array([False, False, True, True])
    return Recording(time, files.STATES, values, rates=rates, unknown_offsets=unknown)


def of_a_pendulum():
    """With quadratic drag: the polynomial library has neither, and comes near."""
    time = np.arange(2001) / 25
    states = moved(
        lambda t, x: [x[1], -9 * np.sin(x[0]) - 0.05 * abs(x[1]) * x[1]], (2.0, 0.0), time
    )
    return of_displacement(time, states, 0.005, seed=5)


QUICK = (growing, growing_with_its_velocity, on_its_limit_cycle, decaying, line, driven,
         with_an_accelerometer, of_a_pendulum)  # fmt: skip
SLOW = (in_random_forces, of_accelerometers)


# --- the same in other units ---


def units(states, length, time):
    """(n_states,) what states are multiplied by in units so many times as small."""
    factors = np.full(len(states), float(length))
    factors[list(velocity_pairs(states).values())] /= time
    return factors


def in_other_units(recording, length, time):
    """The recording, its lengths and times multiplied by factors."""
    own = units(recording.states, length, time)
    rates = None if recording.rates is None else recording.rates * own / time
    inputs = {name: replace(one, time=time * one.time) for name, one in recording.inputs.items()}
    return replace(
        recording, time=time * recording.time, values=recording.values * own, rates=rates,
        inputs=inputs,
    )  # fmt: skip
