"""Both eliminations of segments' states, against the dense least squares that they solve."""

from types import SimpleNamespace

import numpy as np
import pytest

from galloping.identification.likelihood.elimination import (
    chain_segments,
    eliminate_chains,
    eliminate_with_jumps,
)
from galloping.identification.likelihood.shooting import Linearised, Segments, eliminate_states
from galloping.identification.likelihood.weak_constraint import NormalEquations

COUNT, STATES, N, ROWS = 6, 2, 3, 8
OWNER = np.array([0, 0, 0, 0, 1, 1])
SEGMENTS = Segments(np.arange(COUNT + 1), OWNER, np.arange(COUNT))
RNG = np.random.default_rng(0)
DESIGN = RNG.normal(size=(COUNT, ROWS, N + STATES))
RESIDUAL = RNG.normal(size=(COUNT, ROWS))
STARTS, ENDS = RNG.normal(size=(2, COUNT, STATES))
SLOPES = RNG.normal(size=(COUNT, STATES, N + STATES))


def dense(jump: float) -> np.ndarray:
    """(N + COUNT STATES,) best change of coefficients and states; jump: deviation, 0 where each
    segment begins where the one before ends.
    """
    rows, right = [], []
    for g in range(COUNT):
        own = slice(N + STATES * g, N + STATES * (g + 1))
        block = np.zeros((ROWS, N + STATES * COUNT))
        block[:, :N], block[:, own] = DESIGN[g, :, :N], DESIGN[g, :, N:]
        rows.append(block)
        right.append(RESIDUAL[g])
        if g + 1 < COUNT and OWNER[g] == OWNER[g + 1]:
            following = np.zeros((STATES, N + STATES * COUNT))
            following[:, :N], following[:, own] = -SLOPES[g, :, :N], -SLOPES[g, :, N:]
            following[:, own.stop : own.stop + STATES] = np.eye(STATES)
            rows.append(following / max(jump, 1e-7))
            right.append((ENDS[g] - STARTS[g + 1]) / max(jump, 1e-7))
    return np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]


@pytest.mark.parametrize("jump", [0.0, 0.3])
def test_eliminated_states_leave_the_best_coefficients_and_follow_them(jump: float) -> None:
    if jump:
        both = np.concatenate([DESIGN, RESIDUAL[..., None]], axis=2)
        products = both.transpose(0, 2, 1) @ both
        linear = NormalEquations(
            np.zeros(N), STARTS, products[:, :-1, :-1], products[:, :-1, -1], RESIDUAL, ENDS,
            SLOPES[:, :, :N], SLOPES[:, :, N:],
        )  # fmt: skip
        unknown = SimpleNamespace(with_prior=lambda information, right, _: (information, right))
        record = SimpleNamespace(
            followed_segments=np.flatnonzero(np.diff(OWNER) == 0), problem=unknown
        )
        precision = np.tile(np.eye(STATES) / jump**2, (COUNT, 1, 1))
        found = eliminate_with_jumps(record, linear, precision)
    else:
        rows = np.concatenate([DESIGN, RESIDUAL[..., None]], axis=2).reshape(-1, N + STATES + 1)
        kept, rest = eliminate_states(rows, ROWS * np.arange(COUNT + 1), N)
        information, right = rest[:, :N].T @ rest[:, :N], rest[:, -1] @ rest[:, :N]
        linear = Linearised(kept, information, right, np.zeros((2, 1)), ENDS, SLOPES)
        segments = chain_segments(linear, SEGMENTS)
        assert segments.chains.tolist() == OWNER.tolist()
        found = eliminate_chains(linear, segments, STARTS)
        assert found.gap == pytest.approx(
            np.abs(ENDS - np.roll(STARTS, -1, 0))[[0, 1, 2, 4]].max(0)
        )
    best = dense(jump)
    change = np.linalg.solve(found.information, found.right)
    assert change == pytest.approx(best[:N], rel=1e-5)
    assert found.move_states(change).ravel() == pytest.approx(best[N:], rel=1e-5)
