"""Data that the stages of a study exchange besides recordings and models, and shared names.

The code that computes them is elsewhere, so that its changes leave files readable.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from galloping.model.polynomial import PolynomialModel

# kinds of study cells; prefixes of their names
NOISE = "noise"  # a whole record
SUBSET = "points"  # random samples of a record
JOINT = "joint"  # all recordings of a case together

BOUND = "bound"  # the Cramer-Rao bound, used like the name of a method
# setup and method that agree best with the paper's printed numbers: see `galloping.paper`
PAPER_PROTOCOL, PAPER_METHOD = "derivative", "paper"
IDENTIFIED, KNOWN = "identified", "known"  # kinematic equations in the paper's method
MAIN_METHOD = "maximum_likelihood"  # method that figures compare with the paper's method
MAIN_FAMILY = "likelihood"  # family of the main method


DISPLACEMENT_COLUMNS = {"q_v": 0, "q_w": 1}  # columns of the displacements in the states
TERM_DEGREES = {"linear": 1, "quadratic": 2, "cubic": 3}  # degrees of terms


@dataclass(frozen=True)
class Derived:
    """Equations of an overhead line, with its named coefficients and quantities such as the sag.

    model: its equations. coefficients: by the paper's symbols, SI units, on the left-hand side.
    quantities: such as the sag, by name with unit.
    """

    model: PolynomialModel
    coefficients: Mapping[str, float]
    quantities: Mapping[str, float]


@dataclass(frozen=True)
class Motion:
    """Simulated states of an overhead line, and their derivatives, from one initial state.

    names: of the n_states states. time: (n,) s. states: (n, n_states), SI units.
    rates: (n, n_states), of the states, per second. status: `ok`, or why the motion ended early.
    """

    names: tuple[str, ...]
    time: np.ndarray
    states: np.ndarray
    rates: np.ndarray
    status: str = "ok"


@dataclass(frozen=True)
class Reconstruction:
    """Simulated motion of the model with the median R2, and the 90 % band of all models' motions.

    time: (n,) s. representative, low, high: (n, n_states), NaN where motions ended early.
    """

    time: np.ndarray
    representative: np.ndarray
    low: np.ndarray
    high: np.ndarray
