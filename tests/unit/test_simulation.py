"""The compiled integrator: printed states, a second one, energy, and models that end early."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lines import CASES, RESONANT, START, edited

from galloping.evaluation.motion import steady_amplitude
from galloping.physics.galerkin import at_rest, coefficients, integrate, model
from galloping.polynomial import PolynomialModel
from galloping.simulation import Simulator, time_grid

TIME = time_grid(300, 100)
VARIANTS = {**CASES, "sine": edited(line__mode_shape="sine")}
PRINTED = {
    "internal_resonance": ((0.35202677, 1.81831793, -1.84807987, -0.88856756), (1.106, 1.873)),
    "sine": ((0.17784683, 0.53246272, -1.04591588, -2.64306990), (1.054, 2.132)),
    "non_resonant": ((-0.28807116, -0.63631260, 3.90279507, -0.43758123), (1.770, 0.672)),
}


@pytest.mark.parametrize("name", PRINTED)
def test_printed_motion_on_any_grid(name):
    end, amplitudes = PRINTED[name]
    line = model(coefficients(VARIANTS[name]))
    simulator = Simulator(line.states, line.terms)
    trajectory = simulator(line, START, TIME)
    assert trajectory.status == "ok"
    assert trajectory.states[-1] == pytest.approx(end, rel=0, abs=1e-7)
    steady = trajectory.states[20000:]
    assert steady_amplitude(steady)[:2] == pytest.approx(amplitudes, rel=0, abs=5.1e-4)
    thinned = simulator(line, START, TIME[::100])
    assert thinned.states == pytest.approx(trajectory.states[::100], rel=0, abs=1e-12)


@pytest.mark.parametrize("shape", ["irvine", "sine"])
@settings(max_examples=50)
@given(
    q_v=st.floats(-3, 3), q_w=st.floats(-3, 3), dq_v=st.floats(-3, 3), dq_w=st.floats(-3, 3),
    tension=st.floats(15e3, 60e3),
)  # fmt: skip
def test_energy_is_conserved_without_wind_and_damping(shape, q_v, q_w, dq_v, dq_w, tension):
    case = edited(
        line__tension=tension, line__mode_shape=shape, wind__air_density=0.0,
        damping__vertical=0.0, damping__horizontal=0.0,
    )  # fmt: skip
    still = model(coefficients(case))
    run = Simulator(still.states, still.terms)(
        still, np.array([q_v, q_w, dq_v, dq_w]), time_grid(60, 10)
    )
    energy = energies(case, run.states)
    # the accuracy that is asked of a simulation; 1e-10 J is a motion too small to see
    assert np.ptp(energy) <= 1e-10 * max(energy.max(), 1.0)


def energies(case, states):
    """Kinetic and potential energy in J, from the line's own integrals, not its coefficients."""
    line, phi, psi = at_rest(case)
    q_v, q_w, dq_v, dq_w = states.T
    span = line.span
    stretch = [integrate(mode.slope**2, span) for mode in (phi, psi)]
    bend = [integrate(mode.curvature**2, span) for mode in (phi, psi)]
    sway = line.static_curvature() * integrate(phi.shape, span)
    strain = (-sway * q_v + (stretch[0] * q_v**2 + stretch[1] * q_w**2) / 2) / span
    twice = phi.mass * dq_v**2 + psi.mass * dq_w**2 + line.axial_stiffness * span * strain**2
    for s, b, q in zip(stretch, bend, (q_v, q_w), strict=True):
        twice += (line.tension * s + line.bending_stiffness * b) * q**2
    return twice / 2


@pytest.mark.parametrize("inputs", [(), ("u",)])
def test_motions_in_small_units_do_not_count_as_diverged(inputs):
    terms = tuple(powers + (0,) * len(inputs) for powers in ((1, 0), (0, 1)))
    oscillator = PolynomialModel(("y", "dy"), terms, [[0.0, 1.0], [-200_000.0, -20.0]], inputs)
    simulator = Simulator(oscillator.states, terms, inputs=inputs)
    moved = simulator(oscillator, [45.0, 17_000.0], time_grid(0.1, 600), dict.fromkeys(inputs, 0.0))
    assert moved.status == "ok"
    assert np.abs(moved.states).max() > 10_000


@pytest.mark.parametrize(
    ("values", "reason"),
    [({"gamma_6": 0.0, "gamma_1": -3.0}, "diverged: |x| exceeded 1000 at t = "),
     ({"gamma_2": np.nan}, "diverged: not finite"),
     ({"gamma_1": 1e8}, "stopped: more than 60003 integration steps")],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore")
def test_a_model_that_diverges_ends_early_and_leaves_the_simulator_usable(resonant, values, reason):
    line, trajectory = resonant
    simulator = Simulator(line.states, line.terms)
    ended = simulator(model(coefficients(RESONANT) | values), START, TIME)
    assert ended.status.startswith(reason)
    first = np.argmax(np.isnan(ended.states).any(axis=1))
    assert np.isnan(ended.states[first:]).all()
    if reason.endswith("at t = "):
        assert first > 0 and np.abs(ended.states[:first]).max() <= 1000
        assert float(ended.status.split()[-2]) == pytest.approx(TIME[first], abs=0.02)
    assert simulator(line, START, TIME) == trajectory


def test_time_grid():
    assert time_grid(0.3, 10).tolist() == [0.0, 0.1, 0.2, 0.3]
