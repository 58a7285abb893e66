"""Where motions end up, whatever their size and pace."""

import numpy as np
import pytest

from galloping import parse_model
from galloping.cycles.settling import Pace, estimate_missing_sizes, settle_in_periods
from galloping.model.polynomial import PolynomialModel
from galloping.trajectory.simulation import Simulator

TERMS = ((1, 0), (0, 1), (2, 1), (3, 0))
REST = np.zeros(2)


def oscillator(damping, cubic=0.0, frequency=1.0, size=1.0):
    """q'' = -w^2 q - damping w q' (1 - q^2 / size^2) - cubic w^2 q^3 / size^2."""
    rows = [[0, 1, 0, 0], [-(frequency**2), -damping * frequency, damping * frequency / size**2,
                           -cubic * frequency**2 / size**2]]  # fmt: skip
    return PolynomialModel(("q", "dq"), TERMS, np.array(rows, float))


def ended(model, start, sizes=0.0):
    simulator = Simulator(model.states, model.terms)
    return settle_in_periods(simulator, model, np.array(start), Pace.of(model, REST), sizes)


@pytest.mark.parametrize("frequency", [1.0, 1e6, 1e-5])
@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize(("damping", "kind"), [(-0.1, "cycle"), (0.1, "rest")])
def test_a_motion_is_judged_in_its_own_periods_and_sizes(damping, kind, frequency, size):
    motion = ended(oscillator(damping, 0.0, frequency, size), (0.5 * size, 0.0))
    assert motion.kind == kind
    if kind == "cycle":
        assert motion.half_range[0] == pytest.approx(2.0 * size, rel=5e-3)


def test_a_motion_that_grows_from_nearly_nothing_has_not_died_out():
    sizes = np.array([2.0, 2.0])
    motion = ended(oscillator(-0.05), (1e-6, 0.0), sizes)
    assert motion.kind == "cycle" and motion.half_range[0] == pytest.approx(2.0, rel=5e-3)
    assert ended(oscillator(0.05), (1e-6, 0.0), sizes).kind == "rest"


def test_a_motion_that_settles_slowly_is_followed_for_longer():
    """It grows by e in 318 periods."""
    motion = ended(oscillator(-1e-3), (0.2, 0.0))
    assert motion.kind == "cycle" and motion.half_range[0] == pytest.approx(2.0, rel=2e-2)


def test_a_motion_that_runs_away_diverges():
    assert ended(oscillator(0.1, cubic=-1.0), (2.0, 0.0)).kind.startswith("diverged")


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize("start", [(2.5, 0.3), (0.01, 0.02)])
def test_a_motion_that_dry_friction_holds_has_died_out(start, size):
    """From the second start it is held at once."""
    model = parse_model(f"q = dq; dq = -4 q - {0.9 * size} sign(dq) - 0.02 dq")
    assert ended(model, np.array(start) * size).kind == "rest"


def test_the_pace_is_that_of_oscillations_where_there_are_any():
    model = PolynomialModel(
        ("q", "dq", "x"), ((1, 0, 0), (0, 1, 0), (0, 0, 1)), [[0, 1, 0], [-4, 0, 0], [0, 0, -9]]
    )
    pace = Pace.of(model, np.zeros(3))
    assert (pace.slow, pace.fast) == pytest.approx((np.pi, np.pi), rel=1e-12)
    alone = PolynomialModel(("x",), ((1,),), [[-9.0]])
    assert Pace.of(alone, np.zeros(1)).slow == pytest.approx(2 * np.pi / 9)


def test_sizes_that_are_not_known_follow_from_others():
    model = oscillator(0.0, frequency=3.0)
    assert estimate_missing_sizes(np.array([2.0, 0.0]), model, REST) == pytest.approx([2.0, 6.0])
    assert estimate_missing_sizes(np.array([0.0, 6.0]), model, REST) == pytest.approx([2.0, 6.0])
    assert estimate_missing_sizes(np.zeros(2), model, REST) == pytest.approx([1.0, 1.0])
