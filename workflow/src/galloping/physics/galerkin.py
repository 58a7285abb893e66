"""The galloping equations: gamma and kappa of two coupled oscillators, from the continuous line."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Self

import numpy as np

from galloping.polynomial import PolynomialModel, term_name
from galloping.results import Derived

# --- the hanging line: sag, Irvine parameter, modes of a shallow cable ---


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)  # exact to rounding for these smooth modes


@dataclass(frozen=True)
class Line:
    """An iced bundle of n sub-conductors in one span; forces and stiffnesses of the whole bundle.

    mass: kg/m, tension: N, axial_stiffness (nEA): N, bending_stiffness (nEI): N m2, span: m,
    gravity: m/s2, spacer_mass: kg each, at spacer_positions: m.
    """

    mass: float
    tension: float
    axial_stiffness: float
    bending_stiffness: float
    span: float
    gravity: float
    spacer_mass: float
    spacer_positions: tuple[float, ...]

    @classmethod
    def from_case(cls, case: Mapping) -> Self:
        """The bundle of a `cases` section of the configuration."""
        n = case["bundle"]["subconductors"]
        conductor, line, spacers = case["conductor"], case["line"], case["spacers"]
        return cls(
            mass=n * conductor["mass"],
            tension=n * line["tension"],
            axial_stiffness=n * conductor["tensile_stiffness"],
            bending_stiffness=n * conductor["bending_stiffness"],
            span=line["span"],
            gravity=case["gravity"],
            spacer_mass=spacers["mass"],
            spacer_positions=tuple(spacers["positions"]),
        )

    @property
    def sag(self) -> float:
        """Mid-span sag of the parabola, m."""
        return self.mass * self.gravity * self.span**2 / (8 * self.tension)

    @property
    def irvine_parameter(self) -> float:
        """lambda^2, the ratio of the stiffness by sag to the stiffness by tension (Irvine 1981)."""
        stretch = (self.mass * self.gravity * self.span / self.tension) ** 2
        return stretch * self.axial_stiffness / self.tension

    def static_curvature(self) -> float:
        """y'' of the parabola, 1/m."""
        return self.mass * self.gravity / self.tension


def irvine_root(irvine_parameter: float) -> float:
    """Dimensionless frequency x of the first symmetric in-plane mode, pi < x < 3 pi.

    Root of tan(x/2) = x/2 - (4/lambda^2)(x/2)^3 (Irvine 1981), written without its poles.
    """
    from scipy.optimize import brentq  # slow to import

    def characteristic(z: float) -> float:
        return sin(z) - cos(z) * (z - 4 * z**3 / irvine_parameter)

    return 2 * brentq(characteristic, pi / 2, 3 * pi / 2, xtol=1e-15, rtol=1e-15)


@dataclass(frozen=True)
class Mode:
    """A mode shape at the quadrature nodes of the span and at the spacers.

    shape, slope, curvature: (n_nodes,), 1, 1/m, 1/m2. at_spacers: (n_spacers,).
    """

    shape: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    at_spacers: np.ndarray


def positions(span: float) -> np.ndarray:
    """Quadrature nodes along the span, m."""
    return span * (_NODES + 1) / 2


def weights(span: float) -> np.ndarray:
    """Weights of the quadrature at `positions`, m."""
    return _WEIGHTS * span / 2


def integrate(values: np.ndarray, span: float) -> float:
    """<f>, the integral over the span of values at `positions`."""
    return float(values @ _WEIGHTS) * span / 2


def sine_mode(line: Line, order: int = 1) -> Mode:
    """sin(order pi s / l)."""
    k = pi * order / line.span
    s = positions(line.span)
    spacers = np.asarray(line.spacer_positions, dtype=float)
    return Mode(np.sin(k * s), k * np.cos(k * s), -(k**2) * np.sin(k * s), np.sin(k * spacers))


def irvine_mode(line: Line) -> Mode:
    """First symmetric in-plane mode of a shallow sagging cable, scaled to 1 at mid-span.

    1 - tan(x/2) sin(x s/l) - cos(x s/l) written about mid-span, where it has no pole.
    """
    x = irvine_root(line.irvine_parameter)
    k, edge = x / line.span, cos(x / 2)
    scale = 1 / (1 - edge)
    u = k * (positions(line.span) - line.span / 2)
    at_spacers = np.cos(k * (np.asarray(line.spacer_positions, dtype=float) - line.span / 2))
    return Mode(
        scale * (np.cos(u) - edge),
        -scale * k * np.sin(u),
        -scale * k**2 * np.cos(u),
        scale * (at_spacers - edge),
    )


MODES = {"irvine": irvine_mode, "sine": sine_mode}


STATES = ("q_v", "q_w", "dq_v", "dq_w")

# symbol -> (row of the state derivative, exponents of q_v, q_w, dq_v, dq_w)
TERMS = {
    "gamma_1": (2, (0, 0, 1, 0)),
    "gamma_2": (2, (1, 0, 0, 0)),
    "gamma_3": (2, (2, 0, 0, 0)),
    "gamma_4": (2, (0, 2, 0, 0)),
    "gamma_5": (2, (0, 0, 2, 0)),
    "gamma_6": (2, (0, 0, 3, 0)),
    "gamma_7": (2, (3, 0, 0, 0)),
    "gamma_8": (2, (1, 2, 0, 0)),
    "kappa_1": (3, (0, 0, 0, 1)),
    "kappa_2": (3, (0, 1, 0, 0)),
    "kappa_3": (3, (1, 1, 0, 0)),
    "kappa_4": (3, (2, 1, 0, 0)),
    "kappa_5": (3, (0, 3, 0, 0)),
    "kappa_6": (3, (0, 0, 2, 0)),
    "kappa_7": (3, (0, 0, 1, 0)),
    "kappa_8": (3, (1, 0, 0, 0)),
    "kappa_9": (3, (0, 0, 3, 0)),
    "kappa_10": (3, (1, 2, 0, 0)),
}
SYMBOLS = {place: symbol for symbol, place in TERMS.items()}
EQUATIONS = {2: "vertical", 3: "horizontal"}


def model(values: Mapping[str, float]) -> PolynomialModel:
    """The galloping equations with the left-hand-side coefficients `values`, by symbol of TERMS."""
    present = {symbol: value for symbol, value in values.items() if value != 0}
    kinematic = ((0, 0, 1, 0), (0, 0, 0, 1))
    terms = tuple(dict.fromkeys([*kinematic, *(TERMS[symbol][1] for symbol in present)]))
    matrix = np.zeros((len(STATES), len(terms)))
    for row, term in enumerate(kinematic):
        matrix[row, terms.index(term)] = 1.0
    for symbol, value in present.items():
        row, term = TERMS[symbol]
        matrix[row, terms.index(term)] = -value
    return PolynomialModel(STATES, terms, matrix)


def symbol_of(row: int, exponents: tuple[int, ...]) -> str:
    """gamma_i or kappa_i of a term, or its name where the paper has no symbol for it."""
    return SYMBOLS.get((row, exponents)) or term_name(exponents, STATES)


# The paper's digits are damaged; each reading restores them in one way (docs: config/README.md).
# Coefficients of alpha, alpha^2, alpha^3; the static ones drop out of the dynamic equations.
READINGS = {
    "swapped": ((0.442, 2.126, -4.432), (3.330, 0.0, 0.0)),
    "milli": ((0.442, 0.1262, -0.4324), (0.00333, 0.0, 0.0)),
}


def ice_coefficients(ice: Mapping) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(beta_1..beta_3, eta_1..eta_3), vertical and horizontal, of an `ice` section."""
    if ice["reading"] == "custom":
        return tuple(ice["vertical"]), tuple(ice["horizontal"])
    return READINGS[ice["reading"]]


def modes(case: Mapping, line: Line) -> tuple[Mode, Mode]:
    """Mode shapes of the vertical (configured) and the horizontal (sine) motion."""
    return MODES[case["line"]["mode_shape"]](line), sine_mode(line)


def frequencies(line: Line, phi: Mode, psi: Mode) -> tuple[float, float, float, float]:
    """omega_v, omega_w in rad/s and modal masses m_v, m_w in kg (spacers included)."""
    span = line.span
    m_v = line.mass * integrate(phi.shape**2, span) + line.spacer_mass * np.sum(phi.at_spacers**2)
    m_w = line.mass * integrate(psi.shape**2, span) + line.spacer_mass * np.sum(psi.at_spacers**2)
    a1 = -line.static_curvature() * integrate(phi.shape, span) / span
    k_v = (
        line.tension * integrate(phi.slope**2, span)
        + line.bending_stiffness * integrate(phi.curvature**2, span)
        + line.axial_stiffness * span * a1**2
    )
    k_w = line.tension * integrate(psi.slope**2, span) + line.bending_stiffness * integrate(
        psi.curvature**2, span
    )
    return sqrt(k_v / m_v), sqrt(k_w / m_w), float(m_v), float(m_w)


def coefficients(case: Mapping) -> dict[str, float]:
    """gamma_1..gamma_8, kappa_1..kappa_10 of a case (SI units, on the left-hand side).

    Galerkin projection of the line's energies on its two modes, with quasi-static cubic
    aerodynamics, alpha = V_t / U (paper, eqs. 10-13).
    """
    line = Line.from_case(case)
    phi, psi = modes(case, line)
    omega_v, omega_w, m_v, m_w = frequencies(line, phi, psi)
    span, stretch = line.span, line.axial_stiffness * line.span

    # dynamic strain: a1 q_v + a2 q_v^2 + a3 q_w^2
    a1 = -line.static_curvature() * integrate(phi.shape, span) / span
    a2 = integrate(phi.slope**2, span) / (2 * span)
    a3 = integrate(psi.slope**2, span) / (2 * span)

    speed = case["wind"]["speed"]
    pressure = 0.5 * case["wind"]["air_density"] * case["bundle"]["dimension"] * speed**2
    (b1, b2, b3), (e1, e2, e3) = ice_coefficients(case["ice"])

    def vertical_load(b: float, power: int) -> float:
        return 0.0 - pressure * b / speed**power * integrate(phi.shape ** (power + 1), span) / m_v

    def horizontal_load(e: float, power: int) -> float:
        shape = phi.shape**power * psi.shape
        return 0.0 - pressure * e / speed**power * integrate(shape, span) / m_w

    return {
        "gamma_1": 2 * case["damping"]["vertical"] * omega_v + vertical_load(b1, 1),
        "gamma_2": omega_v**2,
        "gamma_3": 3 * stretch * a1 * a2 / m_v,
        "gamma_4": stretch * a1 * a3 / m_v,
        "gamma_5": vertical_load(b2, 2),
        "gamma_6": vertical_load(b3, 3),
        "gamma_7": 2 * stretch * a2**2 / m_v,
        "gamma_8": 2 * stretch * a2 * a3 / m_v,
        "kappa_1": 2 * case["damping"]["horizontal"] * omega_w,
        "kappa_2": omega_w**2,
        "kappa_3": 2 * stretch * a1 * a3 / m_w,
        "kappa_4": 2 * stretch * a2 * a3 / m_w,
        "kappa_5": 2 * stretch * a3**2 / m_w,
        "kappa_6": horizontal_load(e2, 2),
        "kappa_7": horizontal_load(e1, 1),
        "kappa_8": 0.0,
        "kappa_9": horizontal_load(e3, 3),
        "kappa_10": 0.0,
    }


def derive(case: Mapping) -> Derived:
    """All that follows from a case without simulating it."""
    line = Line.from_case(case)
    omega_v, omega_w, m_v, m_w = frequencies(line, *modes(case, line))
    values = coefficients(case)
    quantities = {
        "sag_m": line.sag,
        "irvine_parameter": line.irvine_parameter,
        "irvine_root_over_pi": irvine_root(line.irvine_parameter) / np.pi,
        "omega_v_rad_s": omega_v,
        "omega_w_rad_s": omega_w,
        "modal_mass_v_kg": m_v,
        "modal_mass_w_kg": m_w,
    }
    return Derived(model(values), values, quantities)
