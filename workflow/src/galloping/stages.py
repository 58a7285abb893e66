"""Stages of a study as functions for a script: one line, one motion, one recording."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import as_finite, as_increasing, checked_state, one_thread
from galloping.configuration.load import load, plain
from galloping.configuration.settings import Settings
from galloping.configuration.yaml_file import ConfigurationError
from galloping.evaluation.bounds import Experiment, on_library, state_bound
from galloping.line.galerkin import coefficients
from galloping.line.galerkin import make_model as equations_of
from galloping.model.polynomial import PolynomialModel, velocity_pairs
from galloping.recording.measurement import PROTOCOLS_BY_NAME, Motion, recordings_of
from galloping.recording.samples import Input, Recording, inputs_at_times
from galloping.trajectory.simulation import (
    Simulator,
    Trajectory,
    check_inputs,
    escape_distance,
    rates_along,
)


def derive(**sections: Mapping[str, object] | float) -> PolynomialModel:
    """Derive the galloping equations of an overhead line in a steady wind.

    The equations are a Galerkin projection on the first vertical and horizontal mode, with
    quasi-static cubic aerodynamics.

    Parameters
    ----------
    **sections : mapping
        Sections of a case in config/README.md, such as `wind={"speed": 14}`. Missing keys have
        their defaults.

    Returns
    -------
    PolynomialModel
        With the states q_v, q_w, m, and dq_v, dq_w, m/s.

    Raises
    ------
    ConfigurationError
        A ValueError with one line for each problem.
    """
    if keys := sorted(Settings.model_fields.keys() & sections.keys()):
        text = f"{keys[0]}: is a key of a study; must be a key of one case, such as wind"
        raise ConfigurationError(f"{text}, without `cases:`")
    try:
        settings = load({"cases": {"line": sections}})
    except ConfigurationError as error:
        raise ConfigurationError(str(error).replace("cases.line.", "")) from None
    return equations_of(coefficients(plain(settings.cases["line"])))


def simulate(
    model: PolynomialModel,
    initial_state: ArrayLike,
    time: ArrayLike,
    inputs: Mapping[str, Input | float] | None = None,
) -> Trajectory:
    """Simulate the states of a model at given times from an initial state.

    Parameters
    ----------
    model : PolynomialModel
    initial_state : (n_states,) array
        State at time[0].
    time : (n,) array
        Increasing times, s.
    inputs : mapping of str to Input or float, optional
        Every input of the model by name, measured or constant.

    Returns
    -------
    Trajectory

    Raises
    ------
    ValueError
        If an argument has another form.
    """
    _check_model(model)
    start = checked_state(initial_state, model.states)
    simulator = Simulator(model.states, model.terms, inputs=model.inputs)
    return simulator(model, start, as_increasing("time", time), inputs, escape_distance(start))


def measure(
    model: PolynomialModel,
    motion: Trajectory,
    *,
    protocol: str = "state",
    level: float = 0.0,
    relative: bool = True,
    seed: int = 0,
    inputs: Mapping[str, Input] | None = None,
) -> Recording:
    """Simulate noisy measurements of a simulated motion, and return them as a recording.

    Parameters
    ----------
    model : PolynomialModel
    motion : Trajectory
        As `simulate` returns it.
    protocol : {"state", "displacement", "acceleration", "derivative"}
        The measurement setup: all states with noise, displacements with noise, accelerations with
        noise, or exact states and derivatives with noise.
    level : float
        Level of the white noise. It is a multiple of the standard deviation of the measured
        quantity if `relative` (0.05 is 5 %), and in SI units otherwise and for `derivative`.
    relative : bool
    seed : int
        The same seed gives the same noise.
    inputs : mapping of str to Input, optional
        Every input of the model by name; they become inputs of the recording.

    Returns
    -------
    Recording

    Raises
    ------
    ValueError
        If the motion ended early, or an argument has another form, such as a relative level above
        one.
    """
    _check_model(model)
    if not isinstance(motion, Trajectory):
        raise ValueError(f"motion: a {type(motion).__name__}; must be what `simulate` returns")
    if motion.status != "ok":
        raise ValueError(f"motion: {motion.status}; there is nothing to measure")
    if motion.states.shape[1] != len(model.states):
        raise ValueError(
            f"motion: has {motion.states.shape[1]} states; the model has {len(model.states)}"
        )
    if protocol not in PROTOCOLS_BY_NAME:
        raise ValueError(f"protocol: {protocol!r}; must be one of {', '.join(PROTOCOLS_BY_NAME)}")
    amount = float(as_finite("level", level, ()))
    if amount < 0:
        raise ValueError(f"level: {level!r}; must be >= 0")
    if amount > 1 and relative and protocol != "derivative":
        raise ValueError(
            f"level: {level!r} is noise of {100 * amount:.4g} % of the motion; {amount:g} % is "
            f"{amount / 100:g}, and an absolute level goes with relative=False"
        )
    given = check_inputs(model, inputs or {}, motion.time)
    measured_inputs = {name: one for name, one in given.items() if isinstance(one, Input)}
    for name in given.keys() - measured_inputs.keys():
        raise ValueError(f"inputs: {name}: {given[name]!r:.60}; must be an Input")
    driving = inputs_at_times(list(measured_inputs.values()), motion.time)
    rates = rates_along(model, motion.states, driving)
    measured = Motion(model.states, motion.time, motion.states, rates)
    replicates = recordings_of(
        [measured], protocol=protocol, level=amount, relative=relative, samples=len(motion.time),
        recordings=1, replicates=1, seed=seed, name=(),
    )  # fmt: skip
    return replace(replicates[0][0], inputs=measured_inputs)


@one_thread
def cramer_rao_bound(
    model: PolynomialModel,
    initial_state: ArrayLike,
    time: ArrayLike,
    sigma: ArrayLike,
    rate_sigma: ArrayLike | None = None,
    inputs: Mapping[str, Input | float] | None = None,
) -> NDArray[np.float64]:
    """Compute the Cramér-Rao bound on the standard errors of a model's coefficients.

    It is the smallest standard deviation that any unbiased method can reach if it knows the terms.

    Parameters
    ----------
    model : PolynomialModel
    initial_state : (n_states,) array
        State at time[0]; it counts as unknown to the method.
    time : (n,) array
        Increasing times, s.
    sigma : (n_states,) array
        Standard deviation of the noise of each state; infinite for a state that is not measured.
    rate_sigma : (n_states,) array, optional
        The same for the derivative of each state, such as an acceleration.
    inputs : mapping of str to Input or float, optional
        Every input of the model by name; a number is constant.

    Returns
    -------
    (n_states, n_terms) array
        NaN for absent terms and for known equations dX/dt = dX; infinite if the recording does not
        determine the coefficient.

    Raises
    ------
    ValueError
        If the solution of the model diverges, or an argument has another form.
    """
    _check_model(model)
    start = checked_state(initial_state, model.states)
    shape = (len(model.states),)
    noise = {"sigma": as_finite("sigma", sigma, shape, infinite=True)}
    if rate_sigma is not None:
        noise["rate_sigma"] = as_finite("rate_sigma", rate_sigma, shape, infinite=True)
    for name, deviations in noise.items():
        if not np.all(deviations > 0):
            raise ValueError(f"{name}: {deviations.tolist()}; each must be > 0")
    pairs = np.argwhere(model.support)
    free = pairs[~np.isin(pairs[:, 0], list(velocity_pairs(model.states)))]
    times = as_increasing("time", time)
    driving = {
        name: one if isinstance(one, Input) else Input(times[[0, -1]], [one, one], between="linear")
        for name, one in check_inputs(model, inputs or {}, times).items()
    }
    experiment = Experiment(start, times, **noise, inputs=driving)
    return on_library(model, state_bound(model, free, [experiment]))


def _check_model(model: object) -> None:
    if not isinstance(model, PolynomialModel):
        raise ValueError(
            f"model: a {type(model).__name__}; must be a PolynomialModel, such as `derive` returns"
        )
