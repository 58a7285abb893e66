"""Both eliminations of segments' states, against the dense least squares that they solve."""

import numpy as np
import pytest

from galloping.identification.likelihood.elimination import (
    chain_segments,
    eliminate_chains,
    eliminate_with_jumps,
)
from galloping.identification.likelihood.shooting import Linearised, Segments
from galloping.identification.likelihood.square_root import separate_states

COUNT, STATES, N, ROWS = 6, 2, 3, 8
OWNER = np.array([0, 0, 0, 0, 1, 1])
SEGMENTS = Segments(np.arange(COUNT + 1), OWNER, np.arange(COUNT))
RNG = np.random.default_rng(0)
DESIGN = RNG.normal(size=(COUNT, ROWS, N + STATES))
RESIDUAL = RNG.normal(size=(COUNT, ROWS))
STARTS, ENDS = RNG.normal(size=(2, COUNT, STATES))
SLOPES = RNG.normal(size=(COUNT, STATES, N + STATES))


def dense_rows(jump: float) -> tuple[np.ndarray, np.ndarray]:
    """Design (n, N + COUNT STATES) of coefficients and states, and residual; jump: deviation, 0
    where each segment begins where the one before ends.
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
            rows.append(following / (jump or 1e-7))
            right.append((ENDS[g] - STARTS[g + 1]) / (jump or 1e-7))
    return np.vstack(rows), np.concatenate(right)


@pytest.mark.parametrize("jump", [0.0, 0.3, 1e-6])
def test_eliminated_states_leave_the_best_coefficients_and_follow_them(jump: float) -> None:
    rows = np.concatenate([DESIGN, RESIDUAL[..., None]], axis=2).reshape(-1, N + STATES + 1)
    kept, rest = separate_states(rows, ROWS * np.arange(COUNT + 1), N)
    information, right = rest[:, :N].T @ rest[:, :N], rest[:, -1] @ rest[:, :N]
    folds = np.zeros(COUNT, int)
    linear = Linearised(STARTS, kept, folds, information[None], right[None], RESIDUAL, ENDS, SLOPES)
    if jump:
        roots = np.tile(np.eye(STATES) / jump, (COUNT, 1, 1))
        found = eliminate_with_jumps(linear, SEGMENTS, roots)
        root = np.linalg.inv(np.linalg.qr(dense_rows(jump)[0][:, N:], mode="r"))
        told = root @ root.T  # not by squares of rows, which lose half of the digits
        for g in range(COUNT):
            own = slice(STATES * g, STATES * (g + 1))
            assert found.variance[g] == pytest.approx(told[own, own], rel=1e-5)
        both = np.hstack([-SLOPES[0, :, N:], np.eye(STATES)])  # of the jump, by two states
        of_jump = both @ told[: 2 * STATES, : 2 * STATES] @ both.T
        assert found.jump_variance[0] == pytest.approx(of_jump, rel=1e-5)
    else:
        segments = chain_segments(linear, SEGMENTS)
        assert segments.chains.tolist() == OWNER.tolist()
        found = eliminate_chains(linear, segments)
        assert found.gap == pytest.approx(
            np.abs(ENDS - np.roll(STARTS, -1, 0))[[0, 1, 2, 4]].max(0)
        )
    best = np.linalg.lstsq(*dense_rows(jump), rcond=None)[0]
    change = np.linalg.solve(found.information, found.right)
    assert change == pytest.approx(best[:N], rel=1e-5)
    assert found.move_states(change).ravel() == pytest.approx(best[N:], rel=1e-5)


def test_what_is_left_out_counts_as_never_recorded() -> None:
    def linearised(some: slice, fold: np.ndarray) -> Linearised:
        own = len(fold)
        rows = np.concatenate([DESIGN[some], RESIDUAL[some][..., None]], axis=2)
        kept, rest = separate_states(rows.reshape(-1, N + STATES + 1), ROWS * np.arange(own + 1), N)
        rest = rest.reshape(own, ROWS, -1)
        parts = [rest[fold == k].reshape(-1, N + STATES + 1) for k in range(fold.max() + 1)]
        return Linearised(
            STARTS[some], kept, fold, np.array([each[:, :N].T @ each[:, :N] for each in parts]),
            np.array([each[:, -1] @ each[:, :N] for each in parts]), RESIDUAL[some], ENDS[some],
            SLOPES[some],
        )  # fmt: skip

    roots, left = np.tile(np.eye(STATES) / 0.3, (COUNT, 1, 1)), slice(2, None)
    whole = linearised(slice(None), np.array([0, 0, 1, 1, 2, 2]))
    alone = linearised(left, np.zeros(COUNT - 2, int))
    found = eliminate_with_jumps(whole, SEGMENTS, roots, left_out=0)
    others = Segments(SEGMENTS.first[2:], OWNER[left], SEGMENTS.chains[left])
    wanted = eliminate_with_jumps(alone, others, roots[left])
    assert found.information == pytest.approx(wanted.information)
    assert found.right == pytest.approx(wanted.right)
    assert found.response[left] == pytest.approx(wanted.response)


def test_a_jump_after_an_unstable_segment_is_no_less_certain_than_without_data() -> None:
    rows = np.concatenate([DESIGN, RESIDUAL[..., None]], axis=2).reshape(-1, N + STATES + 1)
    kept, _ = separate_states(rows, ROWS * np.arange(COUNT + 1), N)
    turn, _ = np.linalg.qr(RNG.normal(size=(STATES, STATES)))
    slopes = SLOPES.copy()
    slopes[:, :, N:] = turn @ np.diag([1e7, 1e-7]) @ turn.T
    none = np.zeros((1, N, N)), np.zeros((1, N))
    linear = Linearised(STARTS, kept, np.zeros(COUNT, int), *none, RESIDUAL, ENDS, slopes)
    deviation = np.array([0.3, 1e-4])
    roots = np.tile(np.diag(1.0 / deviation), (COUNT, 1, 1))
    found = eliminate_with_jumps(linear, SEGMENTS, roots).jump_variance[[0, 1, 2, 4]]
    variance = np.diagonal(found, axis1=1, axis2=2) / deviation**2
    assert variance.min() > 0.0
    assert variance.max() < 1.0 + 1e-3
