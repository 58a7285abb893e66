"""Square-root information filter of segments in chains, compiled.

Rows of least-squares problems are rotated, never multiplied with each other: the information of a
segment on the coefficients is a small part of that on its state, and rounding would hide it.
(G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977.)

Compiled functions that call each other are in one module, for a cached one notices edits of its own
module alone. In functions with fastmath, squares are products: numba would compile `x ** 2` with
the options of the function that is compiled first, and rounding would depend on what that was.
"""

import numpy as np
from numba import njit

FREE, EQUAL, JUMP = range(3)  # how the state of the next segment depends on the end of a segment


def separate_states(rows: np.ndarray, first: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotate least-squares problems so that only the first rows of each contain its state.

    rows: (n_rows, n + n_states + 1) of the problems one after another, overwritten: the design of
    coefficients and of the state, and the residual. first: (n_problems + 1,) first row of each.
    Returns the first rows (n_problems, n_states, n + n_states + 1), and the others, in which the
    first rows are zero, regressions on the coefficients alone. A problem with fewer rows than
    states has rows of zeros besides.
    """
    n_states = rows.shape[1] - n - 1
    lacking = np.maximum(n_states - np.diff(first), 0)
    if lacking.any():
        rows = np.insert(rows, np.repeat(first[1:], lacking), 0.0, axis=0)
        first = first + np.append(0, np.cumsum(lacking))
    _rotate_rows(rows, first, n, n_states)
    places = first[:-1, None] + np.arange(n_states)
    first_rows = rows[places]
    rows[places] = 0.0
    return first_rows, rows


@njit(cache=True, forceinline=True, fastmath={"contract", "nsz"}, error_model="numpy")
def _rotate_rows(rows, first, n, n_states):
    """Rotate rows in place, as of `separate_states`, by Householder's reflections."""
    width = rows.shape[1]
    projection = np.empty(width)
    for g in range(len(first) - 1):
        for c in range(n, n + n_states):
            top, squares = first[g] + c - n, 0.0
            for r in range(top, first[g + 1]):
                squares += rows[r, c] * rows[r, c]
            if squares == 0.0:
                continue
            size, head = np.sqrt(squares), rows[top, c]
            head += size if head > 0.0 else -size  # first entry of Householder's vector
            for k in range(width):
                projection[k] = head * rows[top, k]
            for r in range(top + 1, first[g + 1]):
                normal = rows[r, c]
                for k in range(width):
                    projection[k] += normal * rows[r, k]
            for k in range(width):
                projection[k] /= size * abs(head)
                rows[top, k] -= head * projection[k]
            for r in range(top + 1, first[g + 1]):
                normal = rows[r, c]
                for k in range(width):
                    rows[r, k] -= normal * projection[k]


@njit(cache=True, error_model="numpy")
def _apply_chain_rule(rows, slopes, n, out):
    """Write `rows` to `out`, their state replaced by what it depends on.

    rows: (m, n + n_states) of coefficients and a state. slopes: (n_states, n + n_states) of this
    state by the coefficients and another state.
    """
    for i in range(len(out)):
        for c in range(slopes.shape[1]):
            total = rows[i, c] if c < n else 0.0
            for k in range(len(slopes)):
                total += rows[i, n + k] * slopes[k, c]
            out[i, c] = total


@njit(cache=True, error_model="numpy")
def link_segments(end_derivatives, begins_recording, errors, max_segments, max_growth):
    """Return the chain of each segment, (n_segments,).

    end_derivatives: (n_segments, n_states, n + n_states) of a segment's end by the coefficients and
    its first state. begins_recording: (n_segments,) boolean. errors: (n + n_states,) standard
    errors of the coefficients and of a state from one segment, zero where it has no information.
    max_segments: of a chain. max_growth: Frobenius norm of the derivatives of a chain's end by the
    coefficients and its first state, in these units.
    """
    count, n_states, width = end_derivatives.shape
    n = width - n_states
    chains, length = np.zeros(count, np.int64), 1
    identity = np.eye(n_states, width, n)
    relation, following = identity.copy(), identity.copy()
    for g in range(1, count):
        _apply_chain_rule(end_derivatives[g - 1], relation, n, following)
        growth = 0.0
        for i in range(n_states):
            for c in range(width):
                if errors[n + i] > 0.0:
                    growth += (following[i, c] * errors[c] / errors[n + i]) ** 2
        broken = begins_recording[g] or not growth < max_growth**2 or length >= max_segments
        chains[g] = chains[g - 1] + broken
        length = 1 if broken else length + 1
        relation[:] = identity if broken else following
    return chains


@njit(cache=True, error_model="numpy")
def filter_back(rows, end_derivatives, mismatch, links, roots):
    """Eliminate the states of segments from the last one back to the first.

    rows: (n_segments, m, n + n_states + 1) of the coefficients, a segment's first state and the
    residual. end_derivatives: as of `link_segments`. mismatch: (n_segments, n_states) of the end of
    each segment with the first state of the next. links: (n_segments,) FREE, EQUAL or JUMP. roots:
    (n_segments, n_states, n_states); the product of one and the jump has unit covariance.

    Returns rows (n_segments, n_states, n + n_states + 1) of each segment's first state, which
    contain the information of it and of later ones; the remaining equations (n_segments, m, n + 1)
    of the coefficients; and how the first state of the next segment follows: `relations`
    (n_segments, n_states, n + n_states + 1) to the coefficients, this segment's state and a
    constant, and `spreads` (n_segments, n_states, n_states), a root of its covariance then.
    """
    count, m, width = rows.shape
    n_states = roots.shape[1]
    n, last = width - n_states - 1, width - 1
    kept, relations = np.zeros((2, count, n_states, width))
    remaining, spreads = np.zeros((count, m, n + 1)), np.zeros((count, n_states, n_states))
    later, joint = np.zeros((m + n_states, width)), np.zeros((2 * n_states, width + n_states))
    later_bounds, joint_bounds = np.array([0, m + n_states]), np.array([0, 2 * n_states])
    for g in range(count - 1, -1, -1):
        later[:m] = rows[g]
        _rotate_rows(later, later_bounds, n, n_states)
        kept[g] = later[:n_states]
        remaining[g, :, :n], remaining[g, :, n] = later[n_states:, :n], later[n_states:, last]
        later[m:] = 0.0  # information from here on, on the state of the segment before
        if g == 0 or links[g - 1] == FREE:
            continue
        slopes, gap, relation = end_derivatives[g - 1], mismatch[g - 1], relations[g - 1]
        if links[g - 1] == EQUAL:
            relation[:, :last], relation[:, last] = slopes, gap
            _apply_chain_rule(kept[g], slopes, n, later[m:])
            for i in range(n_states):
                later[m + i, last] = kept[g, i, last]
                for k in range(n_states):
                    later[m + i, last] -= kept[g, i, n + k] * gap[k]
            continue
        # columns: coefficients, state, state of the segment before, residual
        joint[:] = 0.0
        joint[:n_states, : n + n_states] = kept[g, :, :last]
        joint[:n_states, -1] = kept[g, :, last]
        for i in range(n_states):
            for k in range(n_states):
                root = roots[g - 1, i, k]
                joint[n_states + i, n + k] += root
                joint[n_states + i, -1] += root * gap[k]
                for c in range(n):
                    joint[n_states + i, c] -= root * slopes[k, c]
                for c in range(n, last):
                    joint[n_states + i, n_states + c] -= root * slopes[k, c]
        _rotate_rows(joint, joint_bounds, n, n_states)
        later[m:, :n], later[m:, n:] = joint[n_states:, :n], joint[n_states:, n + n_states :]
        for i in range(n_states - 1, -1, -1):
            relation[i, :n], relation[i, n:last] = -joint[i, :n], -joint[i, n + n_states : -1]
            relation[i, last], spreads[g - 1, i, i] = joint[i, -1], 1.0
            for k in range(i + 1, n_states):
                relation[i] -= joint[i, n + k] * relation[k]
                spreads[g - 1, i] -= joint[i, n + k] * spreads[g - 1, k]
            relation[i] /= joint[i, n + i]
            spreads[g - 1, i] /= joint[i, n + i]
    return kept, remaining, relations, spreads


@njit(cache=True, error_model="numpy")
def follow_states(relations, spreads, end_derivatives, begins_chain, first, first_root):
    """Compute the states of all segments from the first ones of chains, and their covariances.

    relations, spreads: as of `filter_back`. begins_chain: (n_segments,) boolean. first: (n_chains,
    n_states, n + 1) responses of its first state to the coefficients, and a constant. first_root:
    (n_chains, n_states, n_states), a root of this state's covariance. Returns responses
    (n_segments, n_states, n + 1), and covariances (n_segments, n_states, n_states) of each state
    and of the jump after it.
    """
    count, n_states, width = relations.shape
    n = width - n_states - 1
    response = np.zeros((count, n_states, n + 1))
    variance, of_jump = np.zeros((2, count, n_states, n_states))
    # covariances are computed as sums of squares: where a motion is unstable, rounding of a product
    # with two large derivatives would exceed them
    root, state, jump = np.zeros((3, 2 * n_states, n_states))
    bounds, chain = np.array([0, 2 * n_states]), -1
    for g in range(count):
        if begins_chain[g]:
            chain += 1
            response[g], root[:n_states] = first[chain], first_root[chain].T
        else:
            relation, spread, slopes = relations[g - 1], spreads[g - 1], end_derivatives[g - 1]
            for i in range(n_states):
                response[g, i, :n], response[g, i, n] = relation[i, :n], relation[i, width - 1]
                jump[n_states:, i], state[n_states:, i] = spread[i], spread[i]
                for k in range(n_states):
                    factor = relation[i, n + k]
                    response[g, i] += factor * response[g - 1, k]
                    for r in range(n_states):
                        state[r, i] += root[r, k] * factor
                        jump[r, i] += root[r, k] * (factor - slopes[i, n + k])
            _add_squares(jump, of_jump[g - 1])
            _rotate_rows(state, bounds, 0, n_states)
            root[:], state[:], jump[:] = state, 0.0, 0.0
        _add_squares(root[:n_states], variance[g])
    return response, variance, of_jump


@njit(cache=True, error_model="numpy")
def _add_squares(root, out):
    """Add the product of the transpose of `root`, (m, n_states), with it to `out`."""
    for r in range(len(root)):
        for i in range(len(out)):
            for j in range(len(out)):
                out[i, j] += root[r, i] * root[r, j]
