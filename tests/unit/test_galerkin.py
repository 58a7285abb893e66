"""Coefficients of the galloping equations: printed numbers, identities, and a second derivation."""

from math import inf, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lines import CASES, edited

from galloping.line import galerkin
from galloping.line.galerkin import Line, derive, irvine_root
from galloping.model.polynomial import design_matrix, polynomial_library

LIBRARY = polynomial_library(4, 4)
UNITS = [tuple(row) for row in np.eye(4, dtype=int).tolist()]


# An independent implementation's numbers, to all the digits that it printed.
NAMES = ("internal_resonance", "sine", "non_resonant")
PRINTED = """
gamma_1         -3.393285e-2   -3.321265e-2   -3.730903e-2
gamma_2             6.979585       7.365574       5.309054
gamma_3            -1.256278      -1.219750   -8.369494e-1
gamma_4         -4.256673e-1   -4.065834e-1   -2.966248e-1
gamma_5         -2.016001e-2   -2.053393e-2   -2.033295e-2
gamma_6          3.064528e-3    3.151880e-3    3.103822e-3
gamma_7          7.545046e-2    5.949446e-2    5.738147e-2
gamma_8          7.669510e-2    5.949446e-2    6.101003e-2
kappa_1          1.344773e-2    1.344773e-2    1.591157e-2
kappa_2             1.808415       1.808415       2.531781
kappa_3         -6.496859e-1   -8.131669e-1   -5.441056e-1
kappa_4          5.852896e-2    5.949446e-2    5.595604e-2
kappa_5          5.949446e-2    5.949446e-2    5.949446e-2
kappa_7         -3.903898e-1   -4.546900e-1   -4.348106e-1
omega_v_rad_s       2.641890       2.713959       2.304138
omega_w_rad_s       1.344773       1.344773       1.591157
sag_m                 6.6217         6.6217         4.7298
irvine_parameter   37.416596      37.416596      13.635786
irvine_root_over_pi 1.964570       1.964570       1.448112
"""
PRINTED = [line.split() for line in PRINTED.strip().splitlines()]
VARIANTS = {**CASES, "sine": edited(line__mode_shape="sine")}


def half_a_digit(text):
    mantissa, _, exponent = text.partition("e")
    return 0.501 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


@pytest.mark.parametrize("name", NAMES)
def test_printed_numbers(name):
    derived = derive(VARIANTS[name])
    values = {**derived.quantities, **derived.coefficients}
    for symbol, *texts in PRINTED:
        text = texts[NAMES.index(name)]
        printed = pytest.approx(float(text), rel=0, abs=half_a_digit(text))
        assert values[symbol] == printed, symbol
    absent = {symbol for symbol, value in derived.coefficients.items() if value == 0}
    assert absent == {"kappa_6", "kappa_8", "kappa_9", "kappa_10"}


# --- a second derivation, from the energies ---


def lagrange(case):
    """Coefficients (2, n_terms) of ddq + ... = 0 of both sine modes by Lagrange's equations."""
    line, wind = Line.from_case(case), case["wind"]
    nodes, weights = np.polynomial.legendre.leggauss(64)
    s, ds = line.span * (nodes + 1) / 2, line.span * weights / 2
    wave = np.pi / line.span
    shape, slope, curvature = np.sin(wave * s), wave * np.cos(wave * s), wave**2 * np.sin(wave * s)
    sag = line.mass * line.gravity / line.tension * (s - line.span / 2)  # its slope, V upward

    def potential(*q):
        v_s, w_s, v_ss, w_ss = (np.outer(each, of) for of in (slope, curvature) for each in q)
        stretch, bend = (v_s**2 + w_s**2) @ ds, (v_ss**2 + w_ss**2) @ ds
        strain = (v_s @ (sag * ds) + stretch / 2) / line.span
        twice = line.tension * stretch + line.bending_stiffness * bend
        return (twice + line.axial_stiffness * line.span * strain**2) / 2

    # the kinetic energy is that of a modal mass, the same in both directions
    at_spacers = np.sin(wave * np.array(line.spacer_positions)) ** 2
    modal_mass = line.mass * shape**2 @ ds + line.spacer_mass * at_spacers.sum()
    states = np.random.default_rng(0).uniform(-1, 1, (200, 4))
    q_v, q_w, dq_v, _ = states.T
    tiny = 1e-30j  # the imaginary part of an analytic function is then its derivative, exactly
    slopes = potential(q_v + tiny, q_w), potential(q_v, q_w + tiny)
    alpha = np.outer(dq_v, shape) / wind["speed"]
    pressure = wind["air_density"] * case["bundle"]["dimension"] * wind["speed"] ** 2 / 2
    rows = []
    ratios = case["damping"]["vertical"], case["damping"]["horizontal"]
    for k, printed in enumerate(galerkin.ice_coefficients(case["ice"])):
        load = pressure * sum(c * alpha**i for i, c in enumerate(printed, start=1))
        work = load @ (shape * ds)  # virtual, per unit of q
        rest = (slopes[k].imag / tiny.imag - work) / modal_mass
        row = np.linalg.lstsq(design_matrix(states, LIBRARY), rest)[0]
        omega = sqrt(row[LIBRARY.index(UNITS[k])])
        row[LIBRARY.index(UNITS[k + 2])] += 2 * ratios[k] * omega
        rows.append(row)
    return rows


ANOTHER = edited(
    line__mode_shape="sine", line__span=240, spacers__positions=[60, 110], wind__speed=9.5,
    ice__reading="custom", ice__vertical=[0.4, 1.1, -3.2], ice__horizontal=[2.1, 0.7, -0.3],
    damping__vertical=0.003, damping__horizontal=0.008, conductor__mass=1.8,
)  # fmt: skip


@pytest.mark.parametrize("case", [VARIANTS["sine"], ANOTHER], ids=["default", "another"])
def test_lagrange_equations_of_the_energies(case):
    expected = dict.fromkeys(galerkin.TERMS, 0.0)
    for row, equation in zip((2, 3), lagrange(case), strict=True):
        for exponents, value in zip(LIBRARY, equation, strict=True):
            if abs(value) > 1e-12:
                expected[galerkin.symbol_of(row, exponents)] = value
    assert set(expected) == set(galerkin.TERMS)  # the energies give no term that we do not have
    assert galerkin.coefficients(case) == pytest.approx(expected, rel=1e-9, abs=1e-12)


# --- what always holds ---


def test_irvine_roots():
    # to half a unit of the last printed digit
    printed = {0.1: 1.004097, 1: 1.040200, 10: 1.345125, 20: 1.609536, 80: 2.480130}
    roots = [irvine_root(irvine_parameter) / pi for irvine_parameter in printed]
    assert roots == pytest.approx(list(printed.values()), abs=5.1e-7)
    assert irvine_root(4 * pi**2) / pi == pytest.approx(2, abs=5.1e-13)
    assert irvine_root(inf) / pi == pytest.approx(2.8606, abs=5.1e-5)


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
    mode, s = galerkin.irvine_mode(line), galerkin.positions(span)
    x = irvine_root(line.irvine_parameter)

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
    # the derivatives, by parts: the mode is zero at both ends
    by_parts = -galerkin.integrate(mode.shape * mode.curvature, span)
    assert galerkin.integrate(mode.slope**2, span) == pytest.approx(by_parts, rel=1e-9)
