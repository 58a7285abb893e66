"""The hanging line against the numbers of an independent implementation."""

from math import inf, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from galloping.physics.galerkin import (
    Line,
    integrate,
    irvine_mode,
    irvine_root,
    positions,
    sine_mode,
)


@pytest.fixture
def line(cases):
    return Line.from_case(cases["internal_resonance"])


@pytest.mark.parametrize(
    ("name", "sag", "irvine_parameter", "root_over_pi"),
    [
        ("internal_resonance", 6.6217, 37.416596, 1.964570),
        ("non_resonant", 4.7298, 13.635786, 1.448112),
    ],
)
def test_static_line(cases, name, sag, irvine_parameter, root_over_pi):
    line = Line.from_case(cases[name])
    assert line.sag == pytest.approx(sag, abs=5.1e-5)
    assert line.irvine_parameter == pytest.approx(irvine_parameter, abs=5.1e-7)
    assert irvine_root(line.irvine_parameter) / pi == pytest.approx(root_over_pi, abs=5.1e-7)


@pytest.mark.parametrize(
    ("irvine_parameter", "root_over_pi", "digit"),
    [
        (0.1, 1.004097, 1e-6),
        (1, 1.040200, 1e-6),
        (10, 1.345125, 1e-6),
        (20, 1.609536, 1e-6),
        (4 * pi**2, 2, 1e-12),
        (80, 2.480130, 1e-6),
        (inf, 2.8606, 1e-4),
    ],
)
def test_irvine_roots(irvine_parameter, root_over_pi, digit):
    # half a unit of the last printed digit
    assert irvine_root(irvine_parameter) / pi == pytest.approx(root_over_pi, abs=0.51 * digit)


@given(st.floats(1e-3, 1e6))
def test_irvine_root_is_the_first_symmetric_one_and_grows(irvine_parameter):
    x = irvine_root(irvine_parameter)
    assert pi < x < 3 * pi
    assert irvine_root(2 * irvine_parameter) > x
    z = x / 2
    assert np.tan(z) == pytest.approx(z - 4 * z**3 / irvine_parameter, rel=1e-6, abs=1e-6)


@given(tension=st.floats(1e4, 1e6), span=st.floats(50, 1000))
def test_irvine_mode_has_the_shape_of_its_definition(tension, span):
    line = Line(6.0, tension, 1.2e8, 200.0, span, 9.81, 4.8, (span / 4, span / 2))
    mode, x, s = irvine_mode(line), irvine_root(line.irvine_parameter), positions(span)

    def unscaled(s):
        return 1 - np.tan(x / 2) * np.sin(x * s / span) - np.cos(x * s / span)

    middle = unscaled(span / 2)
    rounding = 1e-12 * (1 + abs(np.tan(x / 2) / middle)) ** 2  # the pole of the definition
    assert mode.shape == pytest.approx(unscaled(s) / middle, abs=rounding)
    assert mode.at_spacers == pytest.approx(
        unscaled(np.array(line.spacer_positions)) / middle, abs=rounding
    )
    assert mode.at_spacers[1] == pytest.approx(1)
    assert np.max(np.abs(mode.shape)) <= 1 + 1e-12


@pytest.mark.parametrize("shape", [irvine_mode, sine_mode])
def test_derivatives_of_modes(line, shape):
    mode, s = shape(line), positions(line.span)
    # integration by parts, the mode being zero at both ends
    assert integrate(mode.slope**2, line.span) == pytest.approx(
        -integrate(mode.shape * mode.curvature, line.span), rel=1e-12
    )
    # central differences between nodes a few metres apart
    assert np.gradient(mode.shape, s)[30:-30] == pytest.approx(mode.slope[30:-30], abs=5e-5)
