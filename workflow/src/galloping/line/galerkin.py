"""Galloping equations: gamma and kappa of two coupled oscillators, from the continuous line."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Self

import numpy as np

from galloping.model.polynomial import Exponents, PolynomialModel, term_name
from galloping.results import Derived

# --- the hanging line: sag, Irvine parameter, modes of a shallow cable ---


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)  # exact to rounding for these smooth modes


@dataclass(frozen=True)
class Line:
    """Mechanical parameters of an iced conductor bundle in one span.

    Forces and stiffnesses are those of the whole bundle. mass: kg/m, tension: N, axial_stiffness
    (nEA): N, bending_stiffness (nEI): N m2, span: m, gravity: m/s2, spacer_mass: kg each, at
    spacer_positions: m.
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
        """Make the parameters of an overhead line from a case of the configuration."""
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
        """Static sag of the line at mid-span, m."""
        return self.mass * self.gravity * self.span**2 / (8 * self.tension)

    @property
    def irvine_parameter(self) -> float:
        """Irvine's parameter lambda^2, the ratio of the stiffness by sag to that by tension."""
        stretch = (self.mass * self.gravity * self.span / self.tension) ** 2
        return stretch * self.axial_stiffness / self.tension

    def static_curvature(self) -> float:
        """Compute the curvature of the line's static shape, a parabola, in 1/m."""
        return self.mass * self.gravity / self.tension


def irvine_root(irvine_parameter: float) -> float:
    """Compute the dimensionless frequency of a sagging cable's first symmetric in-plane mode.

    irvine_parameter: lambda^2. The frequency x is between pi and 3 pi. It is the root of tan(x/2) =
    x/2 - (4/lambda^2)(x/2)^3 (Irvine 1981), written without its poles.
    """
    from scipy.optimize import brentq  # slow to import

    def characteristic(z: float) -> float:
        return sin(z) - cos(z) * (z - 4 * z**3 / irvine_parameter)

    return 2 * brentq(characteristic, pi / 2, 3 * pi / 2, xtol=1e-15, rtol=1e-15)


@dataclass(frozen=True)
class ModeShape:
    """Values and derivatives of a mode shape at quadrature nodes, and values at spacers.

    shape, slope, curvature: (n_nodes,), 1, 1/m, 1/m2. at_spacers: (n_spacers,).
    """

    shape: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    at_spacers: np.ndarray


def positions(span: float) -> np.ndarray:
    """Return the positions (m) of the quadrature nodes along a span of given length."""
    return span * (_NODES + 1) / 2


def weights(span: float) -> np.ndarray:
    """Return the quadrature weights (m) for integrals along a span of given length."""
    return _WEIGHTS * span / 2


def integrate(values: np.ndarray, span: float) -> float:
    """Integrate a function along a span, given its values at the quadrature nodes."""
    return float(values @ _WEIGHTS) * span / 2


def sine_mode(line: Line, order: int = 1) -> ModeShape:
    """Make the sine mode shape of an overhead line with a given number of half-waves."""
    k, spacers = pi * order / line.span, np.asarray(line.spacer_positions, dtype=float)
    at = k * positions(line.span)
    return ModeShape(np.sin(at), k * np.cos(at), -(k**2) * np.sin(at), np.sin(k * spacers))


def irvine_mode(line: Line) -> ModeShape:
    """Make the first symmetric in-plane mode of a shallow sagging cable, scaled to 1 at mid-span.

    1 - tan(x/2) sin(x s/l) - cos(x s/l) is written about mid-span, where it has no pole.
    """
    x = irvine_root(line.irvine_parameter)
    k, edge = x / line.span, cos(x / 2)
    scale = 1 / (1 - edge)
    u = k * (positions(line.span) - line.span / 2)
    at_spacers = np.cos(k * (np.asarray(line.spacer_positions, dtype=float) - line.span / 2))
    return ModeShape(
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
SYMBOLS: dict[tuple[int, Exponents], str] = {place: symbol for symbol, place in TERMS.items()}
EQUATIONS = {2: "vertical", 3: "horizontal"}  # direction, by row of the state derivative


def make_model(values: Mapping[str, float]) -> PolynomialModel:
    """Make the two-mode galloping model from its coefficients gamma_i and kappa_i, by name."""
    present = [(*TERMS[symbol], -value) for symbol, value in values.items() if value != 0]
    places = [(0, (0, 0, 1, 0), 1.0), (1, (0, 0, 0, 1), 1.0), *present]
    terms = tuple(dict.fromkeys(term for _, term, _ in places))
    matrix = np.zeros((len(STATES), len(terms)))
    for row, term, value in places:
        matrix[row, terms.index(term)] = value
    return PolynomialModel(STATES, terms, matrix)


def symbol_of(row: int, exponents: Exponents) -> str:
    """Return the reproduced paper's symbol of a coefficient, such as gamma_1, or its term."""
    return SYMBOLS.get((row, exponents)) or term_name(exponents, STATES)


# The paper's digits are damaged; each reading restores them in one way (docs: config/README.md).
# Coefficients of alpha, alpha^2, alpha^3; the static ones drop out of the dynamic equations.
READINGS = {
    "swapped": ((0.442, 2.126, -4.432), (3.330, 0.0, 0.0)),
    "milli": ((0.442, 0.1262, -0.4324), (0.00333, 0.0, 0.0)),
}


def ice_coefficients(ice: Mapping) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the aerodynamic coefficients of the ice, vertical and horizontal, from settings.

    ice: an `ice` section. Returns beta_1 to beta_3 and eta_1 to eta_3.
    """
    if ice["reading"] == "custom":
        return tuple(ice["vertical"]), tuple(ice["horizontal"])
    return READINGS[ice["reading"]]


def make_mode_shapes(case: Mapping, line: Line) -> tuple[ModeShape, ModeShape]:
    """Make the vertical and the horizontal mode shape of an overhead line.

    The vertical shape is configured, the horizontal one is a sine.
    """
    return MODES[case["line"]["mode_shape"]](line), sine_mode(line)


@dataclass(frozen=True)
class LinearMode(ModeShape):
    """Mode of an overhead line without wind: shape, modal mass, frequency and dynamic strain.

    mass: modal, kg, spacers included. frequency: rad/s. strain, 1/m, and quadratic, 1/m2: dynamic
    strain of the line by the mode's coordinate and by its square.
    """

    mass: float
    frequency: float
    strain: float
    quadratic: float


def make_line_and_modes(case: Mapping) -> tuple[Line, LinearMode, LinearMode]:
    """Compute an overhead line's parameters and its vertical and horizontal mode, without wind."""
    line = Line.from_case(case)
    phi, psi = make_mode_shapes(case, line)
    strain = -line.static_curvature() * integrate(phi.shape, line.span) / line.span
    return line, _linear_mode(line, phi, strain), _linear_mode(line, psi, 0.0)


def _linear_mode(line: Line, mode: ModeShape, strain: float) -> LinearMode:
    shape, slope, curvature = (
        integrate(values**2, line.span) for values in (mode.shape, mode.slope, mode.curvature)
    )
    mass = float(line.mass * shape + line.spacer_mass * np.sum(mode.at_spacers**2))
    stiffness = line.tension * slope + line.bending_stiffness * curvature
    stiffness += line.axial_stiffness * line.span * strain**2
    quadratic = slope / (2 * line.span)
    shapes = mode.shape, mode.slope, mode.curvature, mode.at_spacers
    return LinearMode(*shapes, mass, sqrt(stiffness / mass), strain, quadratic)


def coefficients(case: Mapping) -> dict[str, float]:
    """Compute the coefficients of the galloping equations of an overhead line, by symbol.

    These are gamma_1 to gamma_8 and kappa_1 to kappa_10, in SI units, on the left-hand side. The
    method is a Galerkin projection of the line's energies on its two modes, with quasi-static cubic
    aerodynamics, alpha = V_t / U (paper, eqs. 10-13).
    """
    line, v, w = make_line_and_modes(case)
    phi, psi, stretch = v.shape, w.shape, line.axial_stiffness * line.span
    a1, a2, a3 = v.strain, v.quadratic, w.quadratic  # strain: a1 q_v + a2 q_v^2 + a3 q_w^2
    speed = case["wind"]["speed"]
    pressure = 0.5 * case["wind"]["air_density"] * case["bundle"]["dimension"] * speed**2
    (b1, b2, b3), (e1, e2, e3) = ice_coefficients(case["ice"])

    def load(coefficient: float, power: int, shapes: np.ndarray, mass: float) -> float:
        return 0.0 - pressure * coefficient / speed**power * integrate(shapes, line.span) / mass

    return {
        "gamma_1": 2 * case["damping"]["vertical"] * v.frequency + load(b1, 1, phi**2, v.mass),
        "gamma_2": v.frequency**2,
        "gamma_3": 3 * stretch * a1 * a2 / v.mass,
        "gamma_4": stretch * a1 * a3 / v.mass,
        "gamma_5": load(b2, 2, phi**3, v.mass),
        "gamma_6": load(b3, 3, phi**4, v.mass),
        "gamma_7": 2 * stretch * a2**2 / v.mass,
        "gamma_8": 2 * stretch * a2 * a3 / v.mass,
        "kappa_1": 2 * case["damping"]["horizontal"] * w.frequency,
        "kappa_2": w.frequency**2,
        "kappa_3": 2 * stretch * a1 * a3 / w.mass,
        "kappa_4": 2 * stretch * a2 * a3 / w.mass,
        "kappa_5": 2 * stretch * a3**2 / w.mass,
        "kappa_6": load(e2, 2, phi**2 * psi, w.mass),
        "kappa_7": load(e1, 1, phi * psi, w.mass),
        "kappa_8": 0.0,
        "kappa_9": load(e3, 3, phi**3 * psi, w.mass),
        "kappa_10": 0.0,
    }


def derive(case: Mapping) -> Derived:
    """Derive the galloping equations of an overhead line, with its sag and frequencies."""
    line, v, w = make_line_and_modes(case)
    values = coefficients(case)
    quantities = {
        "sag_m": line.sag,
        "irvine_parameter": line.irvine_parameter,
        "irvine_root_over_pi": irvine_root(line.irvine_parameter) / np.pi,
        "omega_v_rad_s": v.frequency,
        "omega_w_rad_s": w.frequency,
        "modal_mass_v_kg": v.mass,
        "modal_mass_w_kg": w.mass,
    }
    return Derived(make_model(values), values, quantities)
