"""Two modes that random forces keep up, drawn by number: what displacements alone tell of them."""

from collections.abc import Iterator, Mapping, Sequence
from time import process_time

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from galloping.identification.cell import identify
from galloping.identification.random_forces.modes import decay_interval
from galloping.intervals import generator
from galloping.physics.galerkin import STATES
from galloping.polynomial import library
from galloping.recording import Recording
from galloping.trials.real_lines import COLUMNS, DEGREE, NOISE

FREQUENCIES, DAMPING = (0.4, 1.0), (0.003, 0.02)  # Hz; ratio to critical
DURATIONS, RATES = (300.0, 1200.0), (5.0, 25.0)  # s, Hz
MIXED = 0.3  # most that a mode moves the other coordinate, in its own
APART = 1.15  # least ratio of the two frequencies


def trial(
    seed: int, case: str, replicates: Sequence[int], methods: Mapping[str, Mapping]
) -> Iterator[dict[str, object]]:
    """A row for each replicate and method, as of `real_lines.trial`.

    The slower mode is the vertical one. intervals_held: of the decays of both modes; nothing is
    judged where no random forces are answered. Seconds are those of the processor.
    """
    for replicate in replicates:
        recording, system = drawn(generator(seed, "ambient", case, replicate))
        true, _ = decays(system, ())
        for method, settings in methods.items():
            began, name = process_time(), ("ambient", case, str(replicate))
            terms = library(len(STATES), DEGREE)
            ((found,),) = identify({method: settings}, [[recording]], terms, name).values()
            row = {
                "truth": case, "sensors": "displacements", "method": method,
                "replicate": replicate, "seed": seed, "status": found.status,
                "reason": found.reason, "path": found.diagnostics.get("path", ""),
                "seconds": process_time() - began,
            }  # fmt: skip
            if found.is_forced:
                places = np.argwhere(found.support)
                exponents = np.array(found.model.terms)[places[:, 1]]
                moved = [
                    (i, np.flatnonzero(e)) for (i, _), e in zip(places, exponents, strict=True)
                ]
                said, slopes = decays(found.model.jacobian(np.zeros((1, 4)))[0], moved)
                errors = np.sqrt(np.einsum("mi,ij,mj->m", slopes, found.covariance, slopes))
                lasted, held = found.diagnostics["duration"], []
                row["terms"] = len(places)
                for k, direction in enumerate("vw"):
                    low, high = decay_interval(-said[k].real, errors[k], lasted)
                    held.append(low <= -true[k].real <= high)
                    for quantity, part in (("damping", np.real), ("frequency", np.imag)):
                        off = 100.0 * (part(said[k]) / part(true[k]) - 1.0)
                        row[f"{quantity}_{direction}_error_percent"] = float(off)
                row["intervals_held"] = float(np.mean(held))
            yield dict.fromkeys(COLUMNS, np.nan) | row


def drawn(rng: np.random.Generator) -> tuple[Recording, np.ndarray]:
    """A recording, and the matrix (4, 4) of its equations."""
    omega = np.ones(2)
    while omega.max() < APART * omega.min():
        omega = 2.0 * np.pi * rng.uniform(*FREQUENCIES, 2)
    damping, shapes = rng.uniform(*DAMPING, 2), np.eye(2)
    shapes[[0, 1], [1, 0]] = rng.uniform(-MIXED, MIXED, 2)
    duration, rate = rng.uniform(*DURATIONS), rng.uniform(*RATES)
    inverse, system, forces = np.linalg.inv(shapes), np.eye(4, k=2), np.zeros((4, 4))
    system[2:, :2] = -shapes * omega**2 @ inverse
    system[2:, 2:] = -shapes * (2.0 * damping * omega) @ inverse
    root = shapes * np.sqrt(4.0 * damping * omega**3)  # modes that move as much as each other
    forces[2:, 2:] = root @ root.T
    stationary, step = solve_continuous_lyapunov(system, -forces), expm(system / rate)
    moved = np.linalg.cholesky(stationary - step @ stationary @ step.T)
    states = np.empty((round(duration * rate), 4))
    states[0] = np.linalg.cholesky(stationary) @ rng.standard_normal(4)
    for k in range(1, len(states)):
        states[k] = step @ states[k - 1] + moved @ rng.standard_normal(4)
    values = states + NOISE * states.std(axis=0) * rng.standard_normal(states.shape)
    values[:, 2:] = np.nan
    return Recording(np.arange(len(states)) / rate, STATES, values), system


def decays(
    system: np.ndarray, places: Sequence[tuple[int, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of the modes, 1/s, by frequency, and slopes (n_modes, n_places) of their decays.

    places: of each coefficient its equation and the state that it is of, none of a constant.
    """
    values, right = np.linalg.eig(system)
    left, own = np.linalg.inv(right), np.flatnonzero(values.imag > 0.0)
    own = own[np.argsort(values[own].imag)]
    slopes = [[-(left[m, i] * right[j, m].sum()).real for i, j in places] for m in own]
    return values[own], np.array(slopes)
