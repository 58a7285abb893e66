"""Polynomial models along one parameter, such as the galloping line along its wind speed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from galloping.line import galerkin
from galloping.model.polynomial import PolynomialModel

DIFFERENCE_STEP = 1e-5  # step of central differences, in scales of the parameter: error about 1e-10


@dataclass(frozen=True)
class Family:
    """Family of models dx/dt = C(p) theta(x): terms theta, coefficients C of a parameter p.

    The library of terms is the same at all values of p. model: function of the parameter that
    returns the model; its states and terms must not change. parameter, unit: name and unit of the
    parameter, for reports. sizes: (n_states,) of the motion, in which distances between states are
    measured; one by default, as for a span in SI units.
    """

    model: Callable[[float], PolynomialModel]
    parameter: str = "parameter"
    unit: str = ""
    sizes: np.ndarray | float = 1.0

    def slope(self, value: float, scale: float) -> np.ndarray:
        """Compute the derivative of all coefficients by the parameter, by central differences.

        Shape (n_states, n_terms). scale: of the parameter.
        """
        step = DIFFERENCE_STEP * scale
        above, below = (self.model(value + change).coefficients for change in (step, -step))
        return (above - below) / (2 * step)


def constant_family(model: PolynomialModel, sizes: np.ndarray | float = 1.0) -> Family:
    """Make a family that has the same model at every value of its parameter.

    sizes: as in `Family`.
    """
    return Family(lambda _: model, sizes=sizes)


# every term the derivation can produce, so that the library never changes along a parameter
_DERIVED_TERMS = (exponents for _, exponents in galerkin.TERMS.values())
LIBRARY = tuple(dict.fromkeys([(0, 0, 1, 0), (0, 0, 0, 1), *_DERIVED_TERMS]))


@dataclass(frozen=True)
class Parameter:
    """Parameter of an overhead line that can be varied, with name and unit for reports.

    places: section and key of its value in a case. change: function that changes a case, for a
    parameter without a key of its own.
    """

    label: str
    unit: str
    places: tuple[tuple[str, str], ...] = ()
    change: Callable[[Mapping, float], dict] | None = None

    def at(self, case: Mapping, value: float) -> dict:
        """Return a case (settings of an overhead line and its wind) with this parameter changed."""
        if self.change is not None:
            return self.change(case, value)
        changed = dict(case)
        for section, key in self.places:
            changed[section] = {**changed[section], key: value}
        return changed


def _set_span(case: Mapping, value: float) -> dict:
    """Change the span; spacers keep their relative position."""
    share = value / case["line"]["span"]
    positions = [share * position for position in case["spacers"]["positions"]]
    return {
        **case,
        "line": {**case["line"], "span": value},
        "spacers": {**case["spacers"], "positions": positions},
    }


def _set_ice(direction: str, power: int, case: Mapping, value: float) -> dict:
    vertical, horizontal = map(list, galerkin.ice_coefficients(case["ice"]))
    ice = {"vertical": vertical, "horizontal": horizontal}
    ice[direction][power - 1] = value
    return {**case, "ice": {"reading": "custom", **ice}}


_DAMPING = (("damping", "vertical"), ("damping", "horizontal"))
PARAMETERS = {
    "wind_speed": Parameter("wind speed", "m/s", (("wind", "speed"),)),
    "tension": Parameter("tension of a sub-conductor", "N", (("line", "tension"),)),
    "damping_ratio": Parameter("structural damping ratio", "1", _DAMPING),
    "damping_vertical": Parameter("vertical damping ratio", "1", _DAMPING[:1]),
    "damping_horizontal": Parameter("horizontal damping ratio", "1", _DAMPING[1:]),
    "span": Parameter("span", "m", change=_set_span),
    "spacer_mass": Parameter("mass of a spacer", "kg", (("spacers", "mass"),)),
    "bundle_dimension": Parameter("dimension of the bundle", "m", (("bundle", "dimension"),)),
    **{
        f"ice_{direction}_{power}": Parameter(
            f"{direction} aerodynamic coefficient of order {power}", "1",
            change=partial(_set_ice, direction, power),
        )
        for direction in ("vertical", "horizontal")
        for power in (1, 2, 3)
    },
}  # fmt: skip


def parameter(name: str) -> Parameter:
    """Return the line parameter with a given name, such as `wind_speed`.

    Raises ValueError for a name that no sweep can vary.
    """
    if name not in PARAMETERS:
        raise ValueError(f"{name}: a sweep cannot vary it; it can vary {', '.join(PARAMETERS)}")
    return PARAMETERS[name]


def line_model(case: Mapping) -> PolynomialModel:
    """Derive the two-mode model of an overhead line in a wind, on the common LIBRARY of terms."""
    return galerkin.make_model(galerkin.coefficients(case)).on_library(LIBRARY)


def line_family(case: Mapping, name: str) -> Family:
    """Derive two-mode models of an overhead line along one parameter, such as wind speed.

    name: of PARAMETERS. Raises ValueError for a name that no sweep can vary.
    """
    varied = parameter(name)
    return Family(
        lambda value: line_model(varied.at(case, float(value))), varied.label, varied.unit
    )


def critical_wind(case: Mapping) -> float:
    """Compute in closed form the wind speed, in m/s, at which vertical galloping begins.

    The linear damping gamma_1 of the vertical mode is then zero. The structural damping 2 zeta
    omega equals the aerodynamic one, rho D U b1 <phi^2> / (2 m_v) (Den Hartog 1932 for a mode of
    the span); infinite if the ice does not destabilise.
    """
    line, vertical, _ = galerkin.make_line_and_modes(case)
    (b1, _, _), _ = galerkin.ice_coefficients(case["ice"])
    load = 0.5 * case["wind"]["air_density"] * case["bundle"]["dimension"] * b1
    per_speed = load * galerkin.integrate(vertical.shape**2, line.span) / vertical.mass
    if per_speed <= 0:
        return float("inf")
    return 2 * case["damping"]["vertical"] * vertical.frequency / per_speed


def initial_state(case: Mapping) -> list[float]:
    """Return the initial state of an overhead line, in the order of STATES."""
    return [case["initial_state"][state] for state in galerkin.STATES]
