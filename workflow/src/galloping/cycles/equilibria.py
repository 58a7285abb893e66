"""Equilibria along a parameter: where they lose stability to galloping (Hopf), fold or branch."""

from dataclasses import dataclass
from itertools import combinations
from typing import Self

import numpy as np

from galloping.cycles import continuation
from galloping.cycles.family import Family, VectorField

HOPF, FOLD, BRANCH_POINT = "Hopf", "fold", "branch point"


@dataclass(frozen=True)
class Equilibrium:
    """state: (n_states,) where dx/dt = 0. value: of the parameter."""

    state: np.ndarray
    value: float


@dataclass(frozen=True)
class Eigenvalues:
    """values: (n_states,) of the Jacobian, 1/s. mode: (n_states,) eigenvector of the pair that is
    closest to the imaginary axis, frequency: its imaginary part, rad/s (both zero without one).
    """

    values: np.ndarray
    mode: np.ndarray
    frequency: float

    @property
    def stable(self) -> bool:
        return bool(np.all(self.values.real < 0))


@dataclass(frozen=True)
class _Linearisation:
    rates: np.ndarray
    jacobian: np.ndarray
    by_value: np.ndarray

    def bordered(self, border: continuation.Change) -> np.ndarray:
        upper = np.column_stack([self.jacobian, self.by_value])
        return np.vstack([upper, [*border.parts["state"], border.value]])

    def solve(self, border: continuation.Change, value: float, newton: bool) -> continuation.Change:
        side = np.append(-self.rates if newton else 0 * self.rates, value)
        *state, parameter = np.linalg.solve(self.bordered(border), side)
        return continuation.Change({"state": np.array(state), "value": parameter})


@dataclass(frozen=True)
class EquilibriumProblem:
    """Equilibria of a vector field. resolution: longest step of the parameter; size: of a state."""

    field: VectorField
    resolution: float
    size: float

    def linearise(self, solution: Equilibrium) -> _Linearisation:
        coefficients = self.field.coefficients(solution.value)
        slope = self.field.slope(solution.value, self.resolution)
        parts = self.field(solution.state[np.newaxis], coefficients, slope)
        return _Linearisation(*(part[0] for part in parts))

    def across(self, change: continuation.Change) -> continuation.Change:
        state, value = change.parts["state"] / self.size**2, change.value / self.resolution**2
        return continuation.Change({"state": state, "value": value})

    def along_parameter(self) -> continuation.Change:
        return continuation.Change({"state": np.zeros(self.field.n_states), "value": 1.0})

    def examine(
        self, solution: Equilibrium, linearisation: _Linearisation, tangent: continuation.Change
    ) -> tuple[Eigenvalues, dict[str, float]]:
        values, modes = np.linalg.eig(linearisation.jacobian)
        pair = min(
            (k for k, v in enumerate(values) if v.imag > 0),
            key=lambda k: abs(values[k].real),
            default=None,
        )
        stability = Eigenvalues(
            values,
            np.zeros(len(values), complex) if pair is None else modes[:, pair],
            0.0 if pair is None else float(values[pair].imag),
        )
        sums = np.prod([a + b for a, b in combinations(values, 2)]) if len(values) > 1 else 1.0
        border = self.across(tangent)
        return stability, {
            HOPF: float(np.real(sums)),
            FOLD: tangent.value,
            BRANCH_POINT: float(np.linalg.det(linearisation.bordered(border))),
        }

    def confirmed(self, name: str, stability: Eigenvalues) -> bool:
        """A pair of real eigenvalues of opposite sign is no Hopf bifurcation."""
        if name != HOPF:
            return True
        rates = np.abs(stability.values.real)
        complex_pair = np.abs(stability.values.imag) > 0
        return bool(np.any(complex_pair & (rates < 1e-6 * np.max(np.abs(stability.values)))))

    def moved(self, solution: Equilibrium) -> Self:
        return self

    def refined(self, solution, tangent, stability) -> None:
        return None

    def ended(self, solution, start) -> str:
        return ""

    def signature(self, solution: Equilibrium) -> np.ndarray:
        return solution.state


def equilibrium_branch(
    family: Family,
    state: np.ndarray,
    value: float,
    span: continuation.Range,
    size: float = 1.0,
    upward=True,
) -> continuation.Branch:
    """Equilibria from the one near `state` (n_states,) at `value`, along the parameter.

    size: of a change of the states that matters. upward: whether the parameter grows at first.
    Raises ValueError where there is no equilibrium near the state.
    """
    problem = EquilibriumProblem(VectorField(family, value), span.longest, size)
    along = problem.along_parameter()
    try:
        at = continuation.corrected(problem, Equilibrium(np.asarray(state, float), value), along)
    except continuation.NotConverged as failure:
        message = f"no equilibrium near the given state at {value:g} {family.unit}: {failure}"
        raise ValueError(message) from None
    orientation = along if upward else along.scaled(-1.0)
    return continuation.follow(problem, continuation.point_at(problem, *at, orientation), span)


def hopf_points(branch: continuation.Branch) -> list[continuation.Bifurcation]:
    """The Hopf bifurcations of a branch of equilibria, in its order."""
    return [b for b in branch.bifurcations if b.name == HOPF and b.located]
