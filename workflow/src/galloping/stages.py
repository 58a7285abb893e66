"""The stages of a study as functions for a script: one line, one motion, one recording."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import as_finite, as_increasing, checked_state, one_thread
from galloping.configuration.load import load, plain
from galloping.configuration.yaml_file import ConfigurationError
from galloping.evaluation.bounds import Experiment, on_library, state_bound
from galloping.line.galerkin import coefficients
from galloping.line.galerkin import model as equations_of
from galloping.model.polynomial import PolynomialModel, velocity_pairs
from galloping.recording.measurement import BY_NAME, Motion, recordings_of
from galloping.recording.samples import Input, Recording, inputs_at_times
from galloping.trajectory.simulation import (
    Simulator,
    Trajectory,
    check_inputs,
    escape_distance,
    rates_along,
)


def derive(**sections: Mapping[str, object] | float) -> PolynomialModel:
    """The galloping equations of one line in its wind.

    sections: those of a case in config/README.md, such as `wind={"speed": 14}`; what is left out
    takes its default. Raises ConfigurationError, a ValueError, with one line per problem.
    """
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
    """Motion of a model.

    initial_state: (n_states,) at time[0]. time: (n,) s, increasing. inputs: each of the model's,
    measured or constant. Raises ValueError for other input.
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
    """What an instrument records of a motion of `model`.

    protocol: `state` (all states noisy), `displacement` (velocities not measured), `acceleration`
    (of the velocities, nothing else) or `derivative` (exact states with noisy derivatives). level:
    of the white noise; except for `derivative` times the standard deviation of what is measured if
    `relative`, else absolute: 0.05 is 5 %. The same seed draws the same noise. inputs: those of a
    model that has any, which the recording then carries. Raises ValueError for other input, such as
    a relative level above one, and for a motion that ended early.
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
    if protocol not in BY_NAME:
        raise ValueError(f"protocol: {protocol!r}; must be one of {', '.join(BY_NAME)}")
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
    inputs: Mapping[str, Input] | None = None,
) -> NDArray[np.float64]:
    """Least standard deviation that an unbiased method can reach, of each term of a model.

    initial_state: (n_states,) at time[0], itself unknown to the method. time: (n,) s, increasing.
    sigma: (n_states,) noise of a sample of each state, infinite for one that is not measured.
    rate_sigma: the same of each state's derivative, such as an acceleration; None for none. inputs:
    those of a model that has any.
    Returns (n_states, n_terms): NaN for absent terms and in the equations dX/dt = dX that the names
    of the states tell, infinite where the recording says nothing. Raises ValueError for other
    input, and where the model's solution diverges.
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
    experiment = Experiment(start, as_increasing("time", time), **noise, inputs=inputs or {})
    return on_library(model, state_bound(model, free, [experiment]))


def _check_model(model: object) -> None:
    if not isinstance(model, PolynomialModel):
        raise ValueError(
            f"model: a {type(model).__name__}; must be a PolynomialModel, such as `derive` returns"
        )
