"""Equilibria along a parameter: where they lose stability to galloping (Hopf), fold or branch."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from galloping.cycles import continuation
from galloping.cycles.family import Family, VectorField
from galloping.polynomial import design_matrix

HOPF, FOLD, BRANCH_POINT = "Hopf", "fold", "branch point"


@dataclass(frozen=True)
class Equilibrium:
    """vector: (n_states + 1,), the state where dx/dt = 0 and the value of the parameter."""

    vector: np.ndarray

    @property
    def state(self) -> np.ndarray:
        return self.vector[:-1]

    signature = state

    @property
    def value(self) -> float:
        return float(self.vector[-1])


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
class EquilibriumProblem(continuation.Problem):
    """Equilibria of a vector field. resolution: longest step of the parameter; size: of a state."""

    field: VectorField
    resolution: float
    size: float

    @property
    def metric(self) -> np.ndarray:
        return np.append(np.full(self.field.n_states, self.size), self.resolution) ** -2.0

    def unknowns(self, vector: np.ndarray) -> np.ndarray:
        return vector

    def linearise(self, unknowns: np.ndarray) -> continuation.Linearised:
        model, x = self.field.model(unknowns[-1]), unknowns[np.newaxis, :-1]
        slope = self.field.slope(unknowns[-1], self.resolution)
        by_value = design_matrix(x, model.terms) @ slope.T
        jacobian = np.column_stack([model.jacobian(x)[0], by_value[0]])
        found = Equilibrium(unknowns)
        return continuation.Linearised(
            found, unknowns, model(x)[0], jacobian, np.eye(len(unknowns))
        )

    def examine(
        self, at: continuation.Linearised, tangent: np.ndarray
    ) -> tuple[Eigenvalues, dict[str, float]]:
        values, modes = np.linalg.eig(at.jacobian[:, :-1])
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
        return stability, {
            HOPF: float(np.real(sums)),
            FOLD: tangent[-1],
            BRANCH_POINT: float(np.linalg.det(at.bordered(self.metric * tangent))),
        }

    def confirmed(self, name: str, stability: Eigenvalues) -> bool:
        """A pair of real eigenvalues of opposite sign is no Hopf bifurcation."""
        if name != HOPF:
            return True
        rates = np.abs(stability.values.real)
        complex_pair = np.abs(stability.values.imag) > 0
        return bool(np.any(complex_pair & (rates < 1e-6 * np.max(np.abs(stability.values)))))


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
        at = continuation.corrected(problem, np.append(state, value), along)
    except continuation.NotConverged as failure:
        message = f"no equilibrium near the given state at {value:g} {family.unit}: {failure}"
        raise ValueError(message) from None
    orientation = along if upward else -along
    return continuation.follow(problem, continuation.point_at(problem, at, orientation), span)


def hopf_points(branch: continuation.Branch) -> list[continuation.Bifurcation]:
    """The Hopf bifurcations of a branch of equilibria, in its order."""
    return [b for b in branch.bifurcations if b.name == HOPF and b.located]
