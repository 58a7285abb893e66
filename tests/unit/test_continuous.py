"""The continuous line against independent numbers, a second integrator and conservation laws."""

from functools import cache

import numpy as np
import pytest
from integrators import moved
from lines import RESONANT
from scipy.integrate import quad
from scipy.signal import welch

from galloping.configuration.load import load, plain
from galloping.evaluation import reduction as trial
from galloping.evaluation.score import Truth, evaluate
from galloping.identification.identified_model import IdentifiedModel
from galloping.line import continuous
from galloping.line.continuous import continuous_line, displaced_state, sensor_readings, simulate
from galloping.line.galerkin import STATES, coefficients, make_model
from galloping.line.gusts import SPECTRA, wind_speed

TIME = np.arange(30001) / 100
BARE = {"reading": "custom", "vertical": [0.0, 0.0, 0.0], "horizontal": [0.0, 0.0, 0.0]}


@cache
def released(modes, aerodynamic="small_angle"):
    """The line, and its states at TIME after a release of 0.1 m in both directions."""
    line = continuous_line(RESONANT, modes, aerodynamic=aerodynamic)
    return line, simulate(line, displaced_state(line, (0.1, 0.1)), TIME)


@pytest.mark.parametrize(
    ("modes", "aerodynamic", "frequency", "v", "w"),
    [
        (1, "small_angle", 2.7140, 1.054, 2.132),
        (3, "small_angle", 2.6492, 1.177, 1.957),
        (5, "small_angle", 2.6441, 1.110, 1.940),
        (9, "small_angle", 2.6423, 1.110, 1.911),
        (13, "small_angle", 2.6420, 1.110, 1.908),
        (9, "relative", 2.6423, 1.159, 1.861),
    ],
)
def test_line_on_more_and_more_modes(modes, aerodynamic, frequency, v, w):
    line, states = released(modes, aerodynamic)
    assert continuous.natural_modes(line)[0][0, 0] == pytest.approx(frequency, abs=6e-5)
    middle = sensor_readings(line, states[20000:], [0.5])[:, 0, :2]
    assert np.ptp(middle, axis=0) / 2 == pytest.approx([v, w], abs=6e-4)


def test_one_pair_of_shapes_is_the_model_of_the_paper():
    line = continuous_line(RESONANT, 0)
    end = simulate(line, np.array([0.1, 0.1, 0.0, 0.0]), TIME)[-1]
    # the numbers of physics.md; the fixed step is good to a millionth after 300 s
    expected = [0.35202677, 1.81831793, -1.84807987, -0.88856756]
    assert end == pytest.approx(expected, abs=2e-6)


def test_second_integrator_confirms():
    line = continuous_line(RESONANT, 9, aerodynamic="relative", drag=0.05)
    start = displaced_state(line, (0.5, 0.5), antisymmetric=0.1)
    time = TIME[:6001]

    def wind(t):
        return line.speed * (1 + 0.1 * np.sin(0.3 * t))

    def rates(t, x):
        return line.rates(x, wind(t))

    _, end = moved(rates, start, time[[0, -1]], method="DOP853", rtol=1e-9, atol=1e-10)
    states = simulate(line, start, time, wind(time))
    assert np.abs(states[-1] - end).max() < 1e-4 * np.abs(states).max()


def test_eigenvalues_at_rest_in_the_wind():
    values = continuous.small_motions(continuous_line(RESONANT, 9)).values[:3]
    assert values.real == pytest.approx([-0.00672, 0.01696, 0.01673], abs=6e-6)
    assert values.imag == pytest.approx([1.3448, 2.6423, 2.6895], abs=6e-5)


def test_energy_is_kept_without_wind_and_damping():
    case = RESONANT | {"damping": {"vertical": 0.0, "horizontal": 0.0}}
    case["ice"] = BARE
    line = continuous_line(case, 5)
    states = simulate(line, displaced_state(line, (1.0, 2.0), antisymmetric=0.5), TIME[:3001])
    q, p, dq, dp = states.reshape(len(states), 4, -1).transpose(1, 0, 2)
    k = np.pi * np.arange(1, 6) / line.line.span
    length, tension, bending = line.line.span, line.line.tension, line.line.bending_stiffness
    own = length / 2 * (tension * k**2 + bending * k**4)
    sag = -line.line.static_curvature() * (1 - np.cos(k * length)) / k / length
    strain = q @ sag + (q**2 + p**2) @ (k**2 / 4)
    energy = (q**2 + p**2) @ own / 2 + line.line.axial_stiffness * length * strain**2 / 2
    energy += sum(((x @ m) * x).sum(axis=1) for x, m in zip((dq, dp), line.masses, strict=True)) / 2
    assert np.ptp(energy) < 1e-6 * energy[0]


def test_antisymmetric_mode_gallops_once_disturbed():
    line, quiet = released(9)
    disturbed = simulate(line, displaced_state(line, (0.1, 0.1), antisymmetric=0.01), TIME)
    assert np.abs(quiet[:, 1]).max() < 1e-6
    assert np.ptp(disturbed[25000:, 1]) > 10 * np.ptp(disturbed[:2500, 1])


def test_static_drag_displaces_and_damps():
    line = continuous_line(RESONANT, 3, aerodynamic="relative", drag=1.0)
    rest = continuous.equilibrium(line)
    assert np.abs(line.rates(rest, line.speed)).max() < 1e-9
    assert 0.9 < continuous.shapes_at(line, [0.5])[1] @ rest[3:6] < 1.3
    case = RESONANT | {"ice": BARE}
    light = continuous_line(case, 1, aerodynamic="relative", drag=1e-3)
    both = (light, continuous_line(case, 1))
    growth = [continuous.small_motions(one).values[0].real for one in both]
    expected = light.arrays.pressure * light.speed * 1e-3 * 150 / light.masses[1, 0, 0]
    assert growth[1] - growth[0] == pytest.approx(expected, rel=1e-3)


def test_sensors_read_the_line_and_tell_the_first_modes_apart():
    line = continuous_line(RESONANT, 3)
    states = simulate(line, displaced_state(line, (0.5, 0.5), antisymmetric=0.2), TIME[:2001])
    read = sensor_readings(line, states, continuous.SENSOR_POSITIONS)
    modal = continuous.first_modes(line, read, continuous.SENSOR_POSITIONS)
    assert modal == pytest.approx(states.reshape(-1, 4, 3).transpose(0, 2, 1), abs=1e-10)
    rates = np.array([line.rates(x, line.speed) for x in states])
    slope = np.gradient(read, TIME[1], axis=0)[1:-1]
    error = np.abs(sensor_readings(line, rates, continuous.SENSOR_POSITIONS)[1:-1] - slope)
    assert np.all(error.max(axis=(0, 1)) < 1e-3 * np.abs(slope).max(axis=(0, 1)))


def test_a_short_span_with_many_modes_has_shorter_steps():
    case = {**RESONANT, "line": {**RESONANT["line"], "span": 10.0}}
    case["spacers"] = {**case["spacers"], "positions": [2.5, 5.0, 7.5]}
    line, time = continuous_line(case, 25), TIME[:21]
    states = simulate(line, displaced_state(line, (0.01, 0.01)), time)
    finer = simulate(line, displaced_state(line, (0.01, 0.01)), time, step=2e-4)
    assert states == pytest.approx(finer, abs=1e-3 * np.abs(finer).max())


def test_unknown_aerodynamics_are_refused():
    with pytest.raises(ValueError, match=r"aerodynamics: steady .*small_angle, relative"):
        continuous_line(RESONANT, 1, aerodynamic="steady")


@pytest.mark.parametrize("name", SPECTRA)
def test_wind_has_the_named_spectrum_of_unit_variance_and_the_length_scale(name):
    def density(n):
        return SPECTRA[name](n) / n

    variance = quad(density, 1e-9, 1.0)[0] + quad(density, 1.0, np.inf)[0]
    assert variance == pytest.approx(1.0, rel=2e-3)
    # an integral length of one: the density at zero is four lengths
    assert density(1e-9) == pytest.approx(4.0)
    time = np.arange(2**19) * 0.1
    settings = {"mean": 12.0, "intensity": 0.05, "length_scale": 100.0, "spectrum": name}
    wind = wind_speed(time, **settings, rng=np.random.default_rng(1))
    x = (wind / 12.0 - 1.0) / 0.05
    assert x.mean() == pytest.approx(0.0, abs=0.1)
    assert x.std() == pytest.approx(1.0, rel=0.05)
    frequency, power = welch(x, 10.0, nperseg=4096)
    band = (frequency > 0.01) & (frequency < 2.0)
    reduced = frequency[band] * 100.0 / 12.0
    ratio = power[band] * frequency[band] / SPECTRA[name](reduced)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)
    again = wind_speed(time, **settings, rng=np.random.default_rng(1))
    assert np.array_equal(wind, again)


# --- what two modes are worth ---


def test_table_of_the_two_mode_model_and_lines():
    lines = {
        "3 modes": trial.LineVariant(3),
        "disturbed": trial.LineVariant(3, antisymmetric=0.1),
        "gusty": trial.LineVariant(3, intensity=0.05),
    }
    about = {"length_scale": 100, "spectrum": "kaimal", "seed": 1}
    motions = {name: trial.variant_motion(RESONANT, line, **about) for name, line in lines.items()}
    table = trial.reduction(RESONANT, motions).set_index(["line", "direction"])
    assert len(table) == 8
    model, three = table.loc["two modes"], table.loc["3 modes"]
    assert model["amplitude_m"].to_list() == pytest.approx([1.106, 1.873], abs=2e-3)
    assert model["r2_200_300_s"].to_list() == pytest.approx([1.0, 1.0])
    assert three["amplitude_m"].to_list() == pytest.approx([1.177, 1.957], abs=2e-3)
    error = 100 * (1.106 / 1.177 - 1)
    assert three["amplitude_error_percent"]["vertical"] == pytest.approx(error, abs=0.2)
    assert (three["r2_0_100_s"] > three["r2_200_300_s"]).all()
    assert (three["antisymmetric_m"] < 1e-9).all()
    assert table.loc[("disturbed", "vertical"), "antisymmetric_m"] > 0.1
    assert not np.allclose(table.loc["gusty", "amplitude_m"], three["amplitude_m"], rtol=1e-3)


# --- as the truth of a case: its motion as sensors see it, and how it is judged ---

SHORT = TIME[:3001]


def seen(**truth):
    settings = load({"cases": {"line": {"truth": {"model": "continuous", **truth}}}})
    case = plain(settings)["cases"]["line"]
    start = {"q_v": 0.5, "q_w": 0.5, "dq_v": 0.0, "dq_w": 0.2}
    return continuous.simulate_at_sensors(
        case, case["truth"], start, SHORT, np.random.default_rng(1)
    )


def test_first_modes_of_the_line_as_three_sensors_see_them():
    found = seen(modes=3, antisymmetric=0.3)
    assert found.status == "ok" and found.names == STATES
    # the sagging line swings vertically in more than half a sine
    assert found.states[0] == pytest.approx([0.42, 0.5, 0.0, 0.2], abs=0.01)
    assert np.array_equal(found.states[:, 2:], found.rates[:, :2])
    slope = np.gradient(found.states, SHORT[1], axis=0)[1:-1]
    assert found.rates[1:-1] == pytest.approx(slope, abs=2e-3 * np.abs(slope).max())
    # one sensor at a quarter of the span cannot tell the antisymmetric mode from the first
    blind = seen(modes=3, antisymmetric=0.3, sensors=[0.25])
    assert np.abs(blind.states - found.states)[:, 0].max() > 0.2
    steady, gusty = seen(modes=1), seen(modes=1, gusts={"intensity": 0.05})
    assert np.abs(gusty.states - steady.states)[-1].max() > 1e-3


def test_no_coefficient_is_true_but_the_motion_is_judged():
    line = make_model(coefficients(RESONANT))
    found = seen(modes=3)
    truth = Truth(line, SHORT, found.states, (20.0, 30.0), is_own_model=False)
    unbounded = np.full((1, *line.coefficients.shape), np.nan)
    (row,), _ = evaluate(truth, {"any": [IdentifiedModel(line, is_judged=True)]}, unbounded)
    assert np.isnan([row["e2"], row["missing"], row["mean_error_linear_percent"]]).all()
    assert row["motion"] == "ok" and row["r2_q_v"] > 0.9
    assert np.isfinite(row["amplitude_error_q_w_percent"])
