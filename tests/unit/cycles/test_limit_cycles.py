"""Limit cycles and their bifurcations against published systems and closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp

from galloping.cycles.continuation import Range
from galloping.cycles.diagram import equilibrium_branch, hopf_points
from galloping.cycles.family import Family
from galloping.cycles.limit_cycles import (
    circle,
    cycle_from_motion,
    from_branching,
    from_hopf,
    from_motion,
)
from galloping.model.polynomial import PolynomialModel


def family(terms, matrix):
    names = tuple("xyz"[: len(terms[0])])
    return Family(lambda p: PolynomialModel(names, terms, np.array(matrix(p), float)))


def cycles_of(models, span, state, **options):
    """(equilibria, limit cycles) of the first Hopf bifurcation."""
    equilibria = equilibrium_branch(models, np.array(state, float), span)
    assert equilibria.complete
    return equilibria, from_hopf(models, hopf_points(equilibria)[0], span, **options)


VAN_DER_POL_TERMS = ((1, 0), (0, 1), (2, 1))
VAN_DER_POL = family(VAN_DER_POL_TERMS, lambda mu: [[0, 1, 0], [-1, mu, -mu]])


def van_der_pol(mu, late):
    """States (n, 2) at times (n,), of a motion that began long before, at time zero."""
    rates = VAN_DER_POL.model(mu)
    return solve_ivp(
        lambda _, x: rates(x[np.newaxis])[0], (0, late[-1]), [2, 0], t_eval=late, rtol=1e-9,
        atol=1e-9,
    ).y.T  # fmt: skip


# periods: Amore, arXiv 2111.12198 (2021) and the sources there; amplitude at 1: Hairer, Norsett and
# Wanner, Solving Ordinary Differential Equations I, sec. II.4
@pytest.mark.parametrize(
    ("mu", "period", "amplitude"),
    [(1, 6.66328685932313, 2.00861986), (5, 11.61223066771957, 2.021508),
     (10, 19.07836957, 2.014285)],
)  # fmt: skip
def test_period_and_multiplier_of_van_der_pol(mu, period, amplitude):
    late = np.linspace(60, 100, 2001)
    motion = van_der_pol(0.5, late)
    _, up = from_motion(VAN_DER_POL, 0.5, late, motion, Range(0.1, mu, longest=0.5))
    assert up.complete
    point = up.points[-1]
    assert point.solution.period == pytest.approx(period, rel=2e-9)
    assert point.solution.half_range()[0] == pytest.approx(amplitude, rel=5e-7)
    assert point.stability.trivial_defect <= 1e-6
    if mu == 1:  # Liouville: the multipliers' product is exp of the integral of the divergence
        orbit = point.solution
        divergence = lambda t: mu * (1 - orbit.at(np.array([t]))[0, 0] ** 2)  # noqa: E731
        exponent, _ = quad_vec(divergence, 0, 1)
        expected = np.exp(orbit.period * exponent)
        assert point.stability.multipliers[0] == pytest.approx(expected, rel=1e-5)
        assert -np.log(expected) / period == pytest.approx(1.0594, abs=1e-4)


def test_turns_that_samples_pass_too_far_from_its_end_make_no_longer_period():
    """Seven and a half samples in a period: but every second turn is sampled at other places."""
    period = 6.66328685932313
    time = np.arange(60) * period / 7.5 + 60.0
    found = cycle_from_motion(VAN_DER_POL, 1.0, time, van_der_pol(1.0, time), 0.5)
    assert found.solution.period == pytest.approx(period, rel=2e-9)


def test_a_state_that_rests_on_a_cycle_has_no_range():
    swing = np.array([2.0, 0.0, 1e-16])  # the last by rounding
    orbit = circle(np.array([0.0, 0.3, 0.3]), swing, 1.0, 0.0)
    assert orbit.half_range() == pytest.approx([2.0, 0.0, 0.0], abs=1e-9)


def test_two_folds_of_the_square_prism():
    """Parkinson and Smith, Q. J. Mech. Appl. Math. 17 (1964): galloping of a square prism.

    By the first-order theory of that paper the wind speed of a cycle of amplitude a U is
    A / (A - 3/4 B a^2 + 5/8 C a^4 - 35/64 D a^6) of the critical one; its two extremes are folds.
    """
    a, b, c, d = 2.69, 168.0, 6270.0, 59900.0
    n, damping = 4.3e-4, 1.03e-3

    def matrix(relative):
        wind = relative * 2 * damping / (n * a)
        linear = n * a * wind - 2 * damping
        return [[0, 1, 0, 0, 0], [-1, linear, -n * b / wind, n * c / wind**3, -n * d / wind**5]]

    prism = family(((1, 0), (0, 1), (0, 3), (0, 5), (0, 7)), matrix)
    equilibria, cycles = cycles_of(prism, Range(0.5, 3), [0, 0], sizes=(0.01,))
    assert hopf_points(equilibria)[0].point.solution.value == pytest.approx(1, abs=1e-9)
    assert [b.name for b in cycles.bifurcations] == ["fold of cycles"] * 2 and cycles.complete
    squares = np.sort(np.roots([-105 / 64 * d, 5 / 4 * c, -3 / 4 * b]))
    force = a - 3 / 4 * b * squares + 5 / 8 * c * squares**2 - 35 / 64 * d * squares**3
    assert [b.point.solution.value for b in cycles.bifurcations] == pytest.approx(a / force, 1e-5)
    unstable = [not p.stability.stable for p in cycles.points]
    first, last = unstable.index(True), len(unstable) - unstable[::-1].index(True)
    assert 0 < first < last < len(unstable) and all(unstable[first:last])


def test_neimark_sacker_of_langford():
    """Langford's system: Hopf at 1/2, torus at 2/3, multipliers of a rotation by sqrt(2)/3
    of a turn (Hassard, Kazarinoff and Wan, Theory and Applications of Hopf Bifurcation, 1981)."""
    terms = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (2, 0, 0), (0, 2, 0), (0, 0, 2))
    langford = family(terms, lambda v: [
        [v - 1, -1, 0, 1, 0, 0, 0, 0], [1, v - 1, 0, 0, 1, 0, 0, 0], [0, 0, v, 0, 0, -1, -1, -1],
    ])  # fmt: skip
    equilibria, cycles = cycles_of(langford, Range(0.3, 0.9), [0, 0, 0.3])
    assert hopf_points(equilibria)[0].point.solution.value == pytest.approx(0.5, abs=1e-9)
    (torus,) = cycles.bifurcations
    assert torus.name == "Neimark-Sacker"
    assert torus.point.solution.value == pytest.approx(2 / 3, abs=1e-8)
    expected = np.exp(2j * np.pi * np.sqrt(2) / 3)
    assert torus.point.stability.multipliers[0] == pytest.approx(expected, abs=1e-6)


def test_a_system_of_period_doubling_and_its_branch():
    """Genesio-Tesi jerk equation x''' + a x'' + b x' + x - x^2 = 0: Hopf at a b = 1, and at b = 1 a
    period doubling at a = 0.630302 of period 6.364071 (MatCont's tutorial on limit cycles)."""
    terms = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 0, 0))
    jerk = family(terms, lambda p: [[0, 1, 0, 0], [0, 0, 1, 0], [-1, -1, p, 1]])  # p = -a
    equilibria = equilibrium_branch(jerk, np.zeros(3), Range(-1.2, -0.5))
    (hopf,) = hopf_points(equilibria)
    assert hopf.point.solution.value == pytest.approx(-1.0, abs=1e-9)
    cycles = from_hopf(jerk, hopf, Range(-1.2, -0.5))
    doubling = cycles.bifurcations[0]
    assert doubling.name == "period doubling"
    assert doubling.point.solution.value == pytest.approx(-0.6303020, abs=2e-6)
    assert doubling.point.solution.period == pytest.approx(6.364071, abs=2e-6)
    (doubled,) = from_branching(jerk, doubling, Range(-1.2, -0.5))
    assert doubled.points[0].solution.period == pytest.approx(2 * 6.364071, rel=1e-3)
    assert doubled.points[3].stability.stable


def test_a_branch_point_and_both_branches():
    """x' = p x - x^3 beside a circle of radius one: the circle is a pitchfork at p = 0."""
    terms = ((1, 0, 0), (0, 1, 0), (3, 0, 0), (1, 2, 0), (2, 1, 0), (0, 3, 0), (0, 0, 1), (0, 0, 3))
    models = family(terms, lambda p: [
        [1, -1, -1, -1, 0, 0, 0, 0], [1, 1, 0, 0, -1, -1, 0, 0], [0, 0, 0, 0, 0, 0, p, -1],
    ])  # fmt: skip
    grid = np.linspace(0, 20, 2001)
    circle = np.column_stack([np.cos(grid), np.sin(grid), 0 * grid])
    _, cycles = from_motion(models, -0.5, grid, circle, Range(-0.6, 0.5))
    (at,) = cycles.bifurcations
    assert at.name == "branch point" and at.point.solution.value == pytest.approx(0, abs=1e-8)
    ends = [branch.points[-1] for branch in from_branching(models, at, Range(-0.6, 0.5))]
    heights = sorted(float(np.mean(p.solution.states[:, 2])) for p in ends)
    assert heights == pytest.approx([-np.sqrt(0.5), np.sqrt(0.5)], abs=1e-6)
    assert all(p.stability.stable for p in ends)


def test_failures_say_why_and_keep_the_branch():
    cut = family(VAN_DER_POL_TERMS, lambda p: [[0, 1, 0], [-1, p, -1 if p < 0.5 else np.nan]])
    span = Range(-0.5, 1.0)
    equilibria = equilibrium_branch(cut, np.zeros(2), span)
    assert not equilibria.complete and equilibria.reason
    assert 0.4 < equilibria.points[-1].solution.value < 0.5
    (hopf,) = hopf_points(equilibria)
    cycles = from_hopf(cut, hopf, span)
    assert not cycles.complete and cycles.reason
    assert len(cycles.points) > 10 and cycles.points[-1].solution.value < 0.5
    short = from_hopf(cut, hopf, Range(-0.5, 1.0, max_points=7))
    assert not short.complete and len(short.points) == 7
    with pytest.raises(ValueError, match=r"at 0\.3"):
        grid = np.linspace(0, 20, 2001)
        swing = np.column_stack([np.cos(7 * grid), np.sin(7 * grid)])
        from_motion(VAN_DER_POL, 0.3, grid, 50 * swing, Range(0.1, 1))
    with pytest.raises(ValueError, match="does not come back"):
        from_motion(VAN_DER_POL, 0.3, grid, np.column_stack([grid, grid]), Range(0.1, 1))
    with pytest.raises(ValueError, match="fold"):
        at = equilibrium_branch(FOLDED, np.array([-1.0, 0.0]), Range(-1, 1))
        from_branching(FOLDED, at.bifurcations[0], Range(-1, 1))
    with pytest.raises(ValueError, match=r"low 2 .* high 1"):
        Range(2, 1)


# x' = -p - x^2: a fold of equilibria at 0
FOLDED = family(((0, 0), (2, 0), (0, 1)), lambda p: [[-p, -1, 0], [0, 0, -1]])


def test_equilibria_pass_a_fold():
    branch = equilibrium_branch(FOLDED, np.array([-1.0, 0.0]), Range(-1, 1))
    (fold,) = branch.bifurcations
    assert fold.name == "fold" and fold.point.solution.value == pytest.approx(0, abs=1e-9)
    assert branch.points[-1].solution.state[0] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="no equilibrium near the given state"):
        equilibrium_branch(FOLDED, np.zeros(2), Range(0.5, 1))
