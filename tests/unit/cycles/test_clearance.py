"""Design ellipses against worked values, and the clearance of two orbits."""

import numpy as np
import pytest

from galloping.configuration.load import load, plain
from galloping.physics.measures import (
    FOOT,
    Ellipse,
    cigre,
    clearance,
    davison,
    design_ellipses,
    envelope,
    toye,
)

# major axis, minor axis, lowest point below rest, all in feet
WORKED = [
    (davison(7.9 * FOOT), (10.9, 4.3, 2.0)),
    (toye(1000 * FOOT, 24.99 * FOOT), (9.8, 5.9, 2.0)),
    (cigre(5.72 * FOOT, 0.0281432, bundle=False), (16.9, 6.8, 5.1)),
    (cigre(20.65 * FOOT, 0.0281432, bundle=True), (20, 8, 6)),
]


@pytest.mark.parametrize(("ellipse", "feet"), WORKED)
def test_worked_values(ellipse, feet):
    axes = np.array([ellipse.major, ellipse.minor, ellipse.below]) / FOOT
    assert axes == pytest.approx(feet, abs=0.0501)  # one decimal is given


def test_outline_and_envelope():
    ellipse = Ellipse(major=4.0, minor=1.0, below=1.5)
    assert envelope(ellipse.outline()) == pytest.approx((4.0, 1.0, 1.5))
    assert design_ellipses(plain(load({}))["cases"]["internal_resonance"]).keys() == {
        "Davison", "Toye", "CIGRE 322",
    }  # fmt: skip
    of_150_m = {"line": {"span": 150}, "spacers": {"positions": [75]}}
    short = plain(load({"cases": {"a": of_150_m}}))["cases"]["a"]
    assert design_ellipses(short).keys() == {"Davison", "Toye"}  # its sag is too small for the last


def test_clearance_of_two_circles():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    assert clearance(circle, circle, (3.0, 4.0)) == pytest.approx(3.0, abs=1e-3)
    assert clearance(circle, 2 * circle, (0.0, 6.0)) == pytest.approx(3.0, abs=1e-3)
    assert clearance(circle, circle, (1.5, 0.0)) == 0


def test_what_no_formula_can_say():
    with pytest.raises(ValueError, match=r"sag: 0 m must be > 0"):
        davison(0)
    with pytest.raises(ValueError, match=r"sag: 1 m is too small for the formula of CIGRE 322"):
        cigre(1.0, 0.0276, bundle=True)
