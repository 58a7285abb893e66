"""Continuous line: a span with any number of modes, in the wind, integrated in time.

The partial differential equations of `galerkin`, with the strain of the whole motion, and the load
integrated over the span at every instant. Nothing is truncated to a polynomial of two coordinates,
so that no candidate library contains the result.
"""

from collections import namedtuple
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.polynomial.legendre import legvander
from scipy.optimize import root

from galloping.line.galerkin import (
    STATES,
    Line,
    ice_coefficients,
    make_mode_shapes,
    positions,
    sine_mode,
    weights,
)
from galloping.line.gusts import wind_speed
from galloping.model.modes import Modes
from galloping.results import Motion

AERODYNAMICS = ("small_angle", "relative")
INTEGRATION_STEP = 0.005  # longest step, s: an eightieth of the shortest period of 13 modes
MAX_STEP_PHASE = 0.5  # longest step, in radians of the fastest mode: unstable above 2.8


# the parts of a `Span` from which its rates are computed
Arrays = namedtuple(
    "Arrays",
    "stiffness damping strain quadratic pull stretch shapes loading coefficients pressure relative",
)


@dataclass(frozen=True)
class Span:
    """Discretised overhead line with n in-plane and n out-of-plane mode shapes.

    Its arrays are per unit of modal mass. line: parameters. speed: mean wind, m/s. masses: (2, n,
    n) kg. arrays: stiffness, damping, (2, n, n), 1/s2 and 1/s, M^-1 K and M^-1 C without the
    strain; strain, (n,) 1/m, of the in-plane coordinates; quadratic, (2, n, n) 1/m2, strain by
    their squares; pull, (n,), and stretch, (2, n, n), M^-1 EA l times the derivatives of both;
    shapes, (2, n_nodes, n), at the nodes of the span; loading, (2, n, n_nodes), M^-1 times shape
    times quadrature weight; coefficients, (2, 4) of 1, alpha .. alpha^3; pressure, rho D/2;
    relative, whether the load is that of the full relative wind.
    """

    line: Line
    speed: float
    masses: np.ndarray
    arrays: Arrays

    @property
    def modes(self) -> int:
        """Number n of mode shapes in each direction."""
        return len(self.arrays.strain)

    def rates(self, state: np.ndarray, speed: float) -> np.ndarray:
        """Compute the time derivative of modal displacements and velocities in a given wind.

        state: (q, p, dq, dp), (4 n,), of n in-plane q and n out-of-plane p. speed: m/s.
        """
        rate = np.empty_like(state)
        _fill_rates(state, speed, self.arrays, rate, np.empty((2, self.arrays.shapes.shape[1])))
        return rate


def continuous_line(
    case: Mapping, sines: int = 9, *, aerodynamic: str = "small_angle", drag: float = 0.0
) -> Span:
    """Make a discretised line from a case of the configuration, with sine modes as shapes.

    sines: 0 for the two shapes of `galerkin.make_mode_shapes`, one in each direction. aerodynamic:
    `small_angle`, the paper's alpha = v_t/U and F = rho D U^2 C(alpha)/2, or `relative`, alpha =
    arctan(v_t/(U - w_t)) and the square of the relative speed. drag: static horizontal coefficient;
    with small angles its load is linear in w_t, which damps w. Spacers couple the modes; every mode
    of the linearised line has the case's damping ratio. Raises ValueError for an unknown
    aerodynamic model.
    """
    if aerodynamic not in AERODYNAMICS:
        raise ValueError(f"aerodynamics: {aerodynamic} is none of {', '.join(AERODYNAMICS)}")
    line = Line.from_case(case)
    weight = weights(line.span)
    directions = [[sine_mode(line, k + 1) for k in range(sines)]] * 2
    if sines == 0:
        directions = [[shape] for shape in make_mode_shapes(case, line)]
    shapes, slopes, curvatures, spacers = (
        np.array([np.column_stack([getattr(mode, name) for mode in own]) for own in directions])
        for name in ("shape", "slope", "curvature", "at_spacers")
    )
    masses = line.mass * (shapes.mT * weight) @ shapes + line.spacer_mass * spacers.mT @ spacers
    tension = (slopes.mT * weight) @ slopes
    bending = line.bending_stiffness * (curvatures.mT * weight) @ curvatures
    stiffness = line.tension * tension + bending
    quadratic = tension / (2.0 * line.span)
    strain = -line.static_curvature() * (weight @ shapes[0]) / line.span
    stretch = line.axial_stiffness * line.span
    sag = np.zeros_like(stiffness)
    sag[0] = stretch * np.outer(strain, strain)
    omega, normal = _solve_modes(masses, stiffness + sag)
    ratios = np.array([[case["damping"]["vertical"]], [case["damping"]["horizontal"]]])
    inverse = np.linalg.inv(masses)
    arrays = Arrays(
        stiffness=inverse @ stiffness,
        damping=normal * (2.0 * ratios * omega)[:, np.newaxis] @ normal.mT @ masses,
        strain=strain,
        quadratic=quadratic,
        pull=inverse[0] @ strain * stretch,
        stretch=2.0 * stretch * inverse @ quadratic,
        shapes=shapes,
        loading=inverse @ (shapes.mT * weight),
        coefficients=np.hstack([[[0.0], [drag]], ice_coefficients(case["ice"])]),
        pressure=0.5 * case["wind"]["air_density"] * case["bundle"]["dimension"],
        relative=aerodynamic == "relative",
    )
    return Span(line, float(case["wind"]["speed"]), masses, arrays)


def _solve_modes(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute frequencies (..., n), rad/s, increasing, and mode shapes normalised by mass.

    The matrices are (..., n, n); shapes are in columns.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(inverse @ stiffness @ inverse.mT)
    return np.sqrt(squares), inverse.mT @ vectors


def shapes_at(line: Span, places: Sequence[float]) -> np.ndarray:
    """Evaluate the mode shapes, (2, n_places, n), at places given as fractions of the span."""
    nodes = 2.0 * positions(line.line.span) / line.line.span - 1.0
    points = 2.0 * np.asarray(places) - 1.0
    # exact to rounding: the quadrature nodes are those of a polynomial of high degree
    basis = np.linalg.solve(legvander(nodes, len(nodes) - 1).T, legvander(points, len(nodes) - 1).T)
    return basis.T @ line.arrays.shapes


def natural_modes(line: Span) -> tuple[np.ndarray, np.ndarray]:
    """Compute the natural frequencies (rad/s) and mode vectors of an overhead line without wind.

    Returns frequencies (2, n) and modal coordinates (2, n, n). The first index is in plane, out of
    plane. The modes are in columns, by frequency, scaled to one at mid-span or, if that is their
    node, at a quarter of the span.
    """
    stiffness = line.masses @ line.arrays.stiffness
    stiffness[0] += line.masses[0] @ np.outer(line.arrays.pull, line.arrays.strain)
    omega, coordinates = _solve_modes(line.masses, stiffness)
    middle, quarter = shapes_at(line, (0.5, 0.25)).swapaxes(0, 1)[:, :, np.newaxis] @ coordinates
    scale = np.where(is_symmetric(line, coordinates)[:, np.newaxis], middle, quarter)
    return omega, coordinates / scale


def is_symmetric(line: Span, coordinates: np.ndarray) -> np.ndarray:
    """Decide for each mode of an overhead line whether its shape is symmetric about mid-span.

    coordinates: (2, n, n_shapes).
    """
    shapes = line.arrays.shapes @ coordinates
    return np.sum(shapes * shapes[:, ::-1], axis=1) > 0.0


def equilibrium(line: Span) -> np.ndarray:
    """Find the equilibrium state of an overhead line in the mean wind.

    Returns (4 n,), zero without a static drag. Raises ValueError if no equilibrium is close
    to the line without wind.
    """
    n = 2 * line.modes
    still = np.zeros(n)
    if not line.arrays.coefficients[:, 0].any():
        return np.zeros(2 * n)
    solution = root(lambda x: line.rates(np.concatenate([x, still]), line.speed)[n:], still)
    if not solution.success:
        raise ValueError("no equilibrium of the line in the mean wind was found")
    return np.concatenate([solution.x, still])


def small_motions(line: Span) -> Modes:
    """Compute the oscillating modes of an overhead line about its equilibrium in the mean wind."""
    rest = equilibrium(line)
    columns = [
        (line.rates(rest + change, line.speed) - line.rates(rest - change, line.speed)) / 2e-5
        for change in 1e-5 * np.eye(len(rest))
    ]
    return Modes.of(np.column_stack(columns)).oscillations()


def displaced_state(
    line: Span,
    displacement: Sequence[float],
    velocity: Sequence[float] = (0.0, 0.0),
    *,
    antisymmetric: float = 0.0,
) -> np.ndarray:
    """Make an initial state with given displacements and velocities from the equilibrium.

    Returns (4 n,). displacement, velocity: m and m/s at mid-span, vertical and horizontal, in the
    first symmetric mode of each direction. antisymmetric: m at a quarter of the span, in the first
    antisymmetric in-plane mode.
    """
    state = equilibrium(line).reshape(4, -1)
    _, coordinates = natural_modes(line)
    even = is_symmetric(line, coordinates)
    for direction, moved in enumerate(zip(displacement, velocity, strict=True)):
        first = coordinates[direction][:, np.argmax(even[direction])]
        state[direction::2] += np.outer(moved, first)
    if antisymmetric:
        state[0] += antisymmetric * coordinates[0][:, np.argmin(even[0])]
    return state.ravel()


def simulate(
    line: Span,
    start: np.ndarray,
    time: np.ndarray,
    speed: np.ndarray | None = None,
    step: float = INTEGRATION_STEP,
) -> np.ndarray:
    """Simulate the modal displacements and velocities of an overhead line at given times.

    Returns (q, p, dq, dp), (n, 4 n_modes). start: the state at time[0]. time: (n,) s, equally
    spaced. speed: (n,) wind at those times, linear between them; the mean wind by default. step: s,
    the longest step of the Runge-Kutta method of order 4, which is at most MAX_STEP_PHASE of the
    fastest mode in any case.
    """
    step = min(step, MAX_STEP_PHASE / float(np.max(natural_modes(line)[0])))
    interval = (time[-1] - time[0]) / (len(time) - 1)
    substeps = max(1, int(np.ceil(interval / step - 1e-9)))
    if speed is None:
        speed = np.full(len(time), line.speed)
    start, speed = (np.ascontiguousarray(each, float) for each in (start, speed))
    return _runge_kutta(start, interval / substeps, substeps, speed, line.arrays)


def draw_wind(
    line: Span, gusts: Mapping, time: np.ndarray, rng: np.random.Generator
) -> np.ndarray | None:
    """Draw a random wind speed (m/s) with gusts at given times; None if the wind is steady.

    gusts: of a `truth` section. time: (n,) s.
    """
    return wind_speed(time, mean=line.speed, rng=rng, **gusts) if gusts["intensity"] else None


@njit(
    cache=True,
    forceinline=True,
    fastmath={"contract", "reassoc", "nsz", "arcp"},
    error_model="numpy",
)
def _fill_rates(state, speed, line, rate, load):
    """Fill `rate` (4 n,) for `state` in a wind of `speed`; load: (2, n_nodes), working memory."""
    n, nodes = len(line.strain), line.shapes.shape[1]
    shapes, coefficients, loading = line.shapes, line.coefficients, line.loading
    tension = 0.0
    for j in range(n):
        tension += line.strain[j] * state[j]
        for d in range(2):
            for k in range(n):
                tension += line.quadratic[d, j, k] * state[d * n + j] * state[d * n + k]
    for i in range(nodes):
        up, along = 0.0, 0.0
        for k in range(n):
            up += shapes[0, i, k] * state[2 * n + k]
            along += shapes[1, i, k] * state[3 * n + k]
        if line.relative:
            against = speed - along
            square = against * against + up * up
            angle = np.arctan2(up, against)
            drag = square * coefficients[1, 0]
        else:
            square = speed * speed
            angle = up / speed
            drag = (square - 2.0 * speed * along) * coefficients[1, 0]
        for d in range(2):
            cubic = coefficients[d, 2] + angle * coefficients[d, 3]
            cubic = angle * (coefficients[d, 1] + angle * cubic)
            load[d, i] = line.pressure * square * cubic
        load[1, i] += line.pressure * drag
    for d in range(2):
        for j in range(n):
            total = 0.0 if d else -tension * line.pull[j]
            for i in range(nodes):
                total += loading[d, j, i] * load[d, i]
            for k in range(n):
                stiff = line.stiffness[d, j, k] + tension * line.stretch[d, j, k]
                total -= stiff * state[d * n + k]
                total -= line.damping[d, j, k] * state[(2 + d) * n + k]
            rate[d * n + j] = state[(2 + d) * n + j]
            rate[(2 + d) * n + j] = total


@njit(cache=True, error_model="numpy")
def _runge_kutta(start, step, substeps, wind, line):
    """Integrate as `simulate`, with the arrays of a `Span`."""
    states = np.empty((len(wind), len(start)))
    states[0] = start
    x = start.copy()
    rate, total, moved = np.empty_like(x), np.empty_like(x), np.empty_like(x)
    load = np.empty((2, line.shapes.shape[1]))
    for i in range(1, len(wind)):
        for s in range(substeps):
            total[:] = 0.0
            rate[:] = 0.0
            for stage in range(4):
                ahead = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                share = (s + ahead) / substeps
                for j in range(len(x)):
                    moved[j] = x[j] + ahead * step * rate[j]
                speed = wind[i - 1] + share * (wind[i] - wind[i - 1])
                _fill_rates(moved, speed, line, rate, load)
                weight = step / 6.0 if stage == 0 or stage == 3 else step / 3.0
                for j in range(len(x)):
                    total[j] += weight * rate[j]
            for j in range(len(x)):
                x[j] += total[j]
        states[i] = x
    return states


SENSOR_POSITIONS = (0.25, 0.5, 0.75)  # places of sensors that distinguish three modes, in spans


def sensor_readings(line: Span, states: np.ndarray, places: Sequence[float]) -> np.ndarray:
    """Compute displacements and velocities at sensors along the span from modal coordinates.

    Returns (n, n_sensors, 4): vertical and horizontal, m, then their velocities, m/s. states: (n, 4
    n_modes); of their rates, the result is velocities and accelerations, m/s2. places: shares of
    the span.
    """
    coordinates = states.reshape(len(states), 2, 2, line.modes)
    readings = np.einsum("dsk,nhdk->nshd", shapes_at(line, places), coordinates)
    return readings.reshape(*readings.shape[:2], 4)


def first_modes(line: Span, values: np.ndarray, places: Sequence[float]) -> np.ndarray:
    """Convert sensor values along the span to the coordinates of as many sine modes.

    The matrix of sines is inverted. values: (n, n_sensors, ...) at `places`, shares of the span.
    Same shape, by mode.
    """
    where, span = np.multiply(places, line.line.span), line.line.span
    sines = np.sin(np.pi * np.outer(where, np.arange(1, len(where) + 1)) / span)
    return np.einsum("ks,ns...->nk...", np.linalg.inv(sines), values)


def simulate_at_sensors(
    case: Mapping,
    truth: Mapping,
    start: Mapping[str, float],
    time: np.ndarray,
    rng: np.random.Generator,
) -> Motion:
    """Simulate the motion of a continuous line as sensors along its span measure it.

    case: of the configuration. truth: section of that name. start: by state, m and m/s at mid-span,
    initial displacement. time: (n,) s, equally spaced. rng: draws the gusts. Readings of the
    sensors become the coordinates of as many sine modes, of which the first are the states; the
    others are unknown. A motion that is not finite is all NaN.
    """
    load = {"aerodynamic": truth["aerodynamics"], "drag": truth["drag"]}
    line = continuous_line(case, truth["modes"], **load)
    initial = [start[state] for state in STATES]
    state = displaced_state(line, initial[:2], initial[2:], antisymmetric=truth["antisymmetric"])
    speed = draw_wind(line, truth["gusts"], time, rng)
    states = simulate(line, state, time, speed)
    if not np.all(np.isfinite(states)):
        nowhere = np.full((len(time), len(STATES)), np.nan)
        return Motion(STATES, time, nowhere, nowhere, "diverged: not finite")
    winds = np.full(len(time), line.speed) if speed is None else speed
    rates = np.array([line.rates(*each) for each in zip(states, winds, strict=True)])
    first_states, first_rates = (
        first_modes(line, sensor_readings(line, each, truth["sensors"]), truth["sensors"])[:, 0]
        for each in (states, rates)
    )
    return Motion(STATES, time, first_states, first_rates)
