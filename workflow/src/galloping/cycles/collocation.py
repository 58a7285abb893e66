"""Periodic orbits by orthogonal collocation at Gauss points, condensed to the mesh points.

On each interval of the mesh the orbit is the polynomial of degree STAGES that satisfies the
equations at the Gauss points (the implicit Runge-Kutta method of Gauss; Hairer, Norsett and Wanner,
Solving Ordinary Differential Equations I, sec. II.7). The interior values are eliminated interval
by interval, what remains couples the mesh points alone (de Boor and Swartz, SIAM J. Numer. Anal.
10, 1973; Doedel, Keller and Kernevez, Int. J. Bifurcation Chaos 1, 1991), and the matrices that
carry one mesh point to the next multiply to the monodromy matrix.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from galloping.cycles.continuation import Change
from galloping.cycles.family import VectorField

STAGES = 4


def _gauss(stages: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes c on (0, 1), a[j, k] = integral of the k-th Lagrange polynomial to c_j, weights b."""
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    c = (nodes + 1) / 2
    powers = np.arange(1, stages + 1)
    moments = np.linalg.inv(np.vander(c, increasing=True)) / powers[:, np.newaxis]
    return c, c[:, np.newaxis] ** powers @ moments, weights / 2


C, A, B = _gauss(STAGES)
_NODES = np.concatenate([[0.0], C])  # of the polynomial on an interval
_LEADING = 1 / np.prod(_NODES[:, np.newaxis] - _NODES + np.eye(STAGES + 1), axis=1)

# [j, k]: derivative of the k-th Lagrange polynomial of these nodes at c_j
_SLOPES = (np.vander(C, STAGES, increasing=True) * np.arange(1, STAGES + 1)) @ np.linalg.inv(
    np.vander(_NODES, increasing=True)
)[1:]


@dataclass(frozen=True)
class Orbit:
    """A periodic solution in scaled time t/period on a mesh.

    widths: (n,) of the mesh's intervals, sum 1. mesh_states: (n, n_states) at the left end of each.
    stage_states: (n, STAGES, n_states) at its Gauss points. period: s. value: of the parameter.
    """

    widths: np.ndarray
    mesh_states: np.ndarray
    stage_states: np.ndarray
    period: float
    value: float

    @property
    def nodes(self) -> np.ndarray:
        """(n, STAGES + 1, n_states) at the left end and the Gauss points of each interval."""
        return np.concatenate([self.mesh_states[:, np.newaxis], self.stage_states], axis=1)

    @property
    def stage_weights(self) -> np.ndarray:
        """(n, STAGES) weights of the integral over one period of scaled time."""
        return self.widths[:, np.newaxis] * B

    @property
    def spread(self) -> float:
        """Root mean square distance of the orbit from its mean."""
        w, x = self.stage_weights[..., np.newaxis], self.stage_states
        mean = np.sum(w * x, axis=(0, 1))
        return float(np.sqrt(np.sum(w * (x - mean) ** 2)))

    def at(self, phase: np.ndarray) -> np.ndarray:
        """States (n_phases, n_states) at phases of the period (its fractions, any real number)."""
        edges = np.concatenate([[0.0], np.cumsum(self.widths)])
        phase = np.mod(phase, 1.0)
        i = np.clip(np.searchsorted(edges, phase, side="right") - 1, 0, len(self.widths) - 1)
        local = (phase - edges[i]) / self.widths[i]
        return np.einsum("pk,pks->ps", _lagrange(local), self.nodes[i])

    def sampled(self, per_interval: int = 24) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) in s over one period, end left out, and states (n, n_states)."""
        inner = np.arange(per_interval) / per_interval
        left = np.cumsum(self.widths) - self.widths
        phase = (left[:, np.newaxis] + self.widths[:, np.newaxis] * inner).ravel()
        return phase * self.period, self.at(phase)

    def twice(self) -> Self:
        """The same motion as an orbit of two turns."""
        mesh, stages = np.tile(self.mesh_states, (2, 1)), np.tile(self.stage_states, (2, 1, 1))
        return Orbit(np.tile(self.widths, 2) / 2, mesh, stages, 2 * self.period, self.value)

    def half_range(self) -> np.ndarray:
        """Half of the range of each state over a period: (n_states,)."""
        time, x = self.sampled()
        return (_peak(time, x, self.period) + _peak(time, -x, self.period)) / 2

    def velocity(self) -> np.ndarray:
        """(n, STAGES, n_states) derivative by scaled time at the Gauss points."""
        return _SLOPES @ self.nodes / self.widths[:, np.newaxis, np.newaxis]

    def on(self, widths: np.ndarray) -> Self:
        """The same orbit, interpolated on another mesh."""
        left = np.cumsum(widths) - widths
        stages = (left[:, np.newaxis] + widths[:, np.newaxis] * C).ravel()
        x = self.at(stages).reshape(len(widths), STAGES, -1)
        return Orbit(widths, self.at(left), x, self.period, self.value)

    def roughness(self) -> np.ndarray:
        """(n,) what each interval holds of the interpolation error's root; a good mesh levels it.

        The derivative of order STAGES + 1, from steps of that of order STAGES (de Boor 1973).
        """
        top = np.einsum("k,iks->is", _LEADING, self.nodes) / self.widths[:, np.newaxis] ** STAGES
        distance = (self.widths + np.roll(self.widths, -1)) / 2
        jump = np.linalg.norm(np.roll(top, -1, axis=0) - top, axis=1) / distance
        return self.widths * ((jump + np.roll(jump, 1)) / 2) ** (1 / (STAGES + 1))

    def levelled(self, intervals: int) -> np.ndarray:
        """Widths of a mesh that spreads the roughness evenly."""
        density = self.roughness() / self.widths
        density = np.maximum(density, 0.1 * np.sum(density * self.widths))  # no empty stretches
        edges = np.concatenate([[0.0], np.cumsum(self.widths)])
        mass = np.concatenate([[0.0], np.cumsum(density * self.widths)])
        return np.diff(np.interp(np.linspace(0, mass[-1], intervals + 1), mass, edges / edges[-1]))


def _lagrange(local: np.ndarray) -> np.ndarray:
    """(n, STAGES + 1) Lagrange polynomials of the nodes 0, c_1, ... at places in [0, 1]."""
    difference = local[:, np.newaxis] - _NODES
    columns = [
        np.prod(np.delete(difference, k, axis=1), axis=1) * _LEADING[k] for k in range(STAGES + 1)
    ]
    return np.stack(columns, axis=1)


def _peak(time: np.ndarray, x: np.ndarray, period: float) -> np.ndarray:
    """Maximum of each column of a periodic sample, by the parabola through its highest three."""
    n, columns = len(x), np.arange(x.shape[1])
    top = np.argmax(x, axis=0)
    before, after = (top - 1) % n, (top + 1) % n
    left = (time[top] - time[before]) % period
    right = (time[after] - time[top]) % period
    rise = (x[top, columns] - x[before, columns]) / left
    fall = (x[after, columns] - x[top, columns]) / right
    bend = (fall - rise) / (left + right)
    slope = (rise * right + fall * left) / (left + right)
    lift = np.divide(-(slope**2), 4 * bend, out=np.zeros_like(bend), where=bend < 0)
    return x[top, columns] + lift


def circle(
    centre: np.ndarray, mode: np.ndarray, period: float, value: float, intervals: int
) -> Orbit:
    """centre + Re(mode exp(2 pi i t / period)) on an even mesh."""
    widths = np.full(intervals, 1 / intervals)
    left = np.arange(intervals) / intervals

    def states(phase: np.ndarray) -> np.ndarray:
        return centre + (mode * np.exp(2j * np.pi * phase)[..., np.newaxis]).real

    return Orbit(widths, states(left), states(left[:, np.newaxis] + C / intervals), period, value)


class Linearisation:
    """The collocation equations about an orbit, condensed to its mesh points.

    reference: the orbit whose phase is kept (integral phase condition). coefficients, slope:
    of the vector field at the orbit's parameter.
    """

    def __init__(
        self,
        field: VectorField,
        orbit: Orbit,
        reference: Orbit,
        coefficients: np.ndarray,
        slope: np.ndarray,
    ) -> None:
        n, stages, n_states = orbit.stage_states.shape
        f, jacobian, by_value = field(orbit.stage_states.reshape(-1, n_states), coefficients, slope)
        f, by_value = (a.reshape(n, stages, n_states) for a in (f, by_value))
        jacobian = jacobian.reshape(n, stages, n_states, n_states)
        time = (orbit.period * orbit.widths)[:, np.newaxis, np.newaxis]
        width = orbit.widths[:, np.newaxis, np.newaxis]
        # (interval, stage j, state a, stage k, state b)
        local = -time[..., np.newaxis, np.newaxis] * (
            A[:, np.newaxis, :, np.newaxis] * jacobian.transpose(0, 2, 1, 3)[:, np.newaxis]
        )
        local = local.reshape(n, stages * n_states, stages * n_states)
        local[:, np.arange(stages * n_states), np.arange(stages * n_states)] += 1.0
        af = A @ f
        sides = np.empty((n, stages, n_states, n_states + 3))
        sides[..., :n_states] = np.eye(n_states)
        sides[..., n_states] = width * af
        sides[..., n_states + 1] = time * (A @ by_value)
        sides[..., n_states + 2] = orbit.mesh_states[:, np.newaxis] + time * af - orbit.stage_states
        inner = np.linalg.solve(local, sides.reshape(n, stages * n_states, -1))
        weighted = time[..., np.newaxis] * (B[:, np.newaxis, np.newaxis] * jacobian)
        weighted = weighted.transpose(0, 2, 1, 3).reshape(n, n_states, stages * n_states)
        across = weighted @ inner
        across[..., :n_states] += np.eye(n_states)
        across[..., n_states] += orbit.widths[:, np.newaxis] * (B @ f)
        across[..., n_states + 1] += time[:, 0] * (B @ by_value)
        following = np.roll(orbit.mesh_states, -1, axis=0)
        across[..., n_states + 2] += orbit.mesh_states + time[:, 0] * (B @ f) - following

        self.orbit = orbit
        self._inner = inner.reshape(n, stages, n_states, n_states + 3)
        self._across = across
        # (n, stages, n_states): how a change of the states changes the phase
        self._phase = orbit.stage_weights[..., np.newaxis] * reference.velocity()
        self._ahead = float(np.sum(self._phase * (orbit.stage_states - reference.stage_states)))

    def solve(self, border: Change, value: float, newton: bool) -> Change:
        """The change that meets the border's `value`.

        newton: with the residuals of the equations removed; else along their null space.
        """
        return self._expanded(np.linalg.solve(*self._bordered(border, value, newton)), newton)

    def other_direction(self, border: Change) -> Change:
        """Where the equations have a second null vector, the one across `border`."""
        *_, right = np.linalg.svd(self._bordered(border, 0.0, False)[0])
        return self._expanded(right[-1], False)

    def _expanded(self, solution: np.ndarray, newton: bool) -> Change:
        n, n_states = self.orbit.mesh_states.shape
        mesh = solution[:-2].reshape(n, n_states)
        period, parameter = solution[-2:]
        outer = np.concatenate(
            [mesh, np.broadcast_to([period, parameter, float(newton)], (n, 3))], axis=1
        )
        stages = np.einsum("ijsk,ik->ijs", self._inner, outer)
        parts = {"mesh_states": mesh, "stage_states": stages, "period": period, "value": parameter}
        return Change(parts)

    def _bordered(self, border: Change, value: float, newton: bool) -> tuple:
        n, n_states = self.orbit.mesh_states.shape
        size = n * n_states
        matrix, side = np.zeros((size + 2, size + 2)), np.zeros(size + 2)
        blocks = matrix[:size, :size].reshape(n, n_states, n, n_states)
        i = np.arange(n)
        blocks[i, :, i] = -self._across[..., :n_states]
        blocks[i, :, (i + 1) % n] += np.eye(n_states)
        matrix[:size, size:] = -self._across[..., n_states : n_states + 2].reshape(size, 2)
        for row, stages in ((size, self._phase), (size + 1, border.parts["stage_states"])):
            condensed = np.einsum("ijs,ijsk->ik", stages, self._inner)
            matrix[row, :size] = condensed[:, :n_states].ravel()
            matrix[row, size:] = condensed[:, n_states:-1].sum(axis=0)
            if newton:
                side[row] = -condensed[:, -1].sum()
        matrix[size + 1, size:] += border.parts["period"], border.value
        side[size + 1] += value
        if newton:
            side[:size] = self._across[..., -1].ravel()
            side[size] -= self._ahead
        return matrix, side

    def determinant(self, border: Change) -> tuple[float, float]:
        """Sign and logarithm of the size of the bordered matrix's determinant."""
        sign, log = np.linalg.slogdet(self._bordered(border, 0.0, False)[0])
        return float(sign), float(log)

    def monodromy(self) -> np.ndarray:
        """(n_states, n_states) derivative of the state after one period by the state at phase 0."""
        n_states = self.orbit.mesh_states.shape[1]
        product = np.eye(n_states)
        for matrix in self._across[..., :n_states]:
            product = matrix @ product
        return product
