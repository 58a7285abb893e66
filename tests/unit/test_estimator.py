"""Maximum likelihood as users of pysindy and scikit-learn know models: data in, answers out."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pysindy as ps
import pytest
from matplotlib.figure import Figure
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_is_fitted
from studies import run

import galloping
from galloping import MaximumLikelihood, Recording
from galloping.recording.containers import make_recordings

ROOT = Path(__file__).parents[2]
TIME = np.arange(1200) / 40
DUFFING = galloping.parse_model("q = dq; dq = -4 q - 0.2 dq - q^3;")
DRIVEN = galloping.parse_model("y = -0.8 y + 0.5 F", ["F"])
STATES = ["q", "dq"]


def noisy(states, level=0.02, seed=5):
    return states + np.random.default_rng(seed).normal(0, level, states.shape) * states.std(axis=0)


MOTION = galloping.simulate(DUFFING, [2.0, 0.0], TIME)
X = noisy(MOTION.states)
FORCE = np.sin(1.3 * TIME) + np.sin(0.31 * TIME) ** 3
RESPONSE = galloping.simulate(DRIVEN, [1.0], TIME, {"F": galloping.Input(TIME, FORCE)})
Y = noisy(RESPONSE.states)


@pytest.fixture(scope="module")
def duffing():
    return MaximumLikelihood(feature_names=STATES).fit(X, TIME)


@pytest.fixture(scope="module")
def driven():
    return MaximumLikelihood(input_names=pd.Index(["F"]), feature_names=["y"]).fit(Y, TIME, FORCE)


# --- the answer ---


def test_it_is_the_model_of_the_function(duffing):
    recording = Recording(TIME, STATES, X)
    assert duffing.model_ == galloping.maximum_likelihood(
        recording, galloping.polynomial_library(2, 3)
    )
    assert duffing.recordings_ == [recording]
    assert duffing.equations() == list(duffing.model_.equations())


def test_coefficients_have_errors(duffing):
    table = duffing.coefficients()
    assert [*table.index] == [("q", "dq"), ("dq", "q"), ("dq", "dq"), ("dq", "q^3")]
    true = pd.Series([-4.0, -0.2, -1.0], table.index[1:])
    found = table.loc[true.index]
    assert np.all(np.abs(found.coefficient - true) < 4 * found.standard_error)
    half = (found.high - found.low) / 2
    assert np.allclose(half / found.standard_error, 1.96, rtol=1e-3)
    every = duffing.coefficients(absent=True)
    assert len(every) == duffing.coef_.size == 2 * len(duffing.get_feature_names())
    limit = every.loc[("dq", "q^2")]
    assert limit.coefficient == 0 and limit.low == -limit.high < 0


def test_print_gives_equations_and_verdict(duffing, capsys):
    duffing.print()
    assert capsys.readouterr().out == f"{duffing.model_}\n"


def test_rates_and_motions_are_arrays_as_of_pysindy(duffing):
    x = MOTION.states[::100]
    peer = ps.SINDy(feature_library=ps.PolynomialLibrary(3)).fit(MOTION.states, t=TIME)
    assert duffing.get_feature_names() == [
        name.replace("x0", "q").replace("x1", "dq") for name in peer.get_feature_names()
    ]
    assert np.allclose(duffing.predict(x), DUFFING(x), atol=0.05)
    for several in (duffing.predict([x, x[:3]]), peer.predict([x, x[:3]])):
        assert [each.shape for each in several] == [x.shape, (3, 2)]
    ours = duffing.simulate(x[0], TIME[:200])
    assert ours.shape == peer.simulate(x[0], TIME[:200]).shape
    assert np.abs(ours - MOTION.states[:200]).max() < 0.05


def test_a_motion_that_diverges_warns():
    model = MaximumLikelihood(feature_names=["x"])
    model.model_ = galloping.IdentifiedModel(galloping.parse_model("x = x^2"), is_judged=True)
    with pytest.warns(RuntimeWarning, match="diverged"):
        states = model.simulate([1.0], TIME)
    assert np.isnan(states[-1]).all()


def test_scores(duffing, driven):
    assert 0.99 < duffing.score(X, TIME) < 1.0
    assert duffing.score(MOTION.states, TIME) > duffing.score(X, TIME)
    assert 0.99 < duffing.score(X, TIME, x_dot=DUFFING(MOTION.states)) < 1.0
    assert 0.99 < driven.score(Y, TIME, FORCE) < 1.0
    other = galloping.simulate(galloping.parse_model("q = dq; dq = -9 q"), [1, 0], TIME)
    assert duffing.score(other.states, TIME) < 0.5
    with pytest.raises(ValueError, match="no samples"):
        duffing.score(np.nan * X, TIME)


def test_inputs(driven):
    table = driven.coefficients().coefficient
    assert table.to_dict() == pytest.approx({("y", "y"): -0.8, ("y", "F"): 0.5}, rel=0.05)
    given = (FORCE, pd.DataFrame({"F": FORCE}), {"F": FORCE}, {"F": galloping.Input(TIME, FORCE)},
             lambda t: np.interp(t, TIME, FORCE))  # fmt: skip
    motions = [driven.simulate([1.0], TIME, u) for u in given]
    assert all(np.array_equal(motion, motions[0]) for motion in motions)
    assert driven.simulate([0.0], TIME, {"F": 1})[-1] == pytest.approx(0.5 / 0.8, rel=0.05)
    assert driven.predict(Y[:5], FORCE[:5]).shape == (5, 1)
    assert len(driven.predict([Y, Y[:5]], [FORCE, FORCE[:5]])[1]) == 5
    assert driven.predict(driven.recordings_[0]).shape == Y.shape
    without = Recording(TIME, ["y"], Y)
    for call in (lambda: driven.predict(Y), lambda: driven.predict(without),
                 lambda: driven.score(without), lambda: driven.score(Y, TIME),
                 lambda: driven.simulate([1.0], TIME),
                 lambda: driven.simulate([1.0], TIME, {"G": 1.0})):  # fmt: skip
        with pytest.raises(ValueError, match="u: F is missing"):
            call()


def test_a_model_without_inputs_takes_none(duffing):
    with pytest.raises(ValueError, match="u: must be left out"):
        duffing.predict(X, FORCE)
    other = Recording(TIME, STATES, X, inputs={"G": galloping.Input(TIME, FORCE)})
    assert duffing.predict(other).shape == X.shape
    with pytest.raises(ValueError, match="x: has the states"):
        duffing.score(Recording(TIME, ["a", "b"], X))


def test_what_is_known_and_the_library_are_text():
    model = MaximumLikelihood(
        "q + dq + q^3", feature_names=STATES, known=["dq: q^3 = -1", "dq: dq < 0"]
    ).fit(X, TIME)
    assert model.coefficients().coefficient[("dq", "q^3")] == -1.0
    assert model.coefficients().standard_error[("dq", "q^3")] == 0.0
    own = galloping.Coefficient("dq", (1, 0), mean=-4.0)
    terms = galloping.polynomial_library(2, 3)
    fixed = MaximumLikelihood(terms, feature_names=STATES, known=[own]).fit(X, TIME)
    assert fixed.coefficients().coefficient[("dq", "q")] == -4.0
    with pytest.raises(ValueError, match="degree"):
        MaximumLikelihood("q + dq", degree=2).fit(X, TIME)


@pytest.mark.parametrize(("count", "degree"), [(3, 3), (4, 3), (5, 2)])
def test_the_default_library_follows_the_number_of_states(count, degree):
    still = MaximumLikelihood().fit(np.ones((200, count)), 0.1)
    assert still.model_.model.terms == galloping.polynomial_library(count, degree)


def test_no_model_is_an_answer():
    noise = np.random.default_rng(3).normal(size=(300, 1))
    model = MaximumLikelihood().fit(noise, 0.1)
    assert model.model_.status == "refused" and len(model.coefficients()) == 0
    for call in (model.equations, lambda: model.predict(noise), lambda: galloping.plot_fit(model)):
        with pytest.raises(ValueError, match="there is no model"):
            call()
    assert model._repr_latex_() is None


# --- data ---


def frame():
    return pd.DataFrame(X, pd.Index(TIME, name="time"), STATES)


def frames():
    dates = pd.Timestamp("2026-01-30") + pd.to_timedelta(TIME, "s")
    yield "index", frame(), {}
    yield "dates", frame().set_index(dates), {}
    yield "zone", frame().set_index(dates.tz_localize("Europe/Oslo")), {}
    yield "column t", frame().rename_axis("t").reset_index(), {}
    yield "named column", frame().reset_index(), {"t": "time"}
    yield "mapping", {"t": TIME, "q": X[:, 0], "dq": X[:, 1]}, {}
    yield "trajectory", galloping.Trajectory(TIME, X, "ok", ("q", "dq")), {}
    yield "recording", Recording(TIME, STATES, X), {}


@pytest.mark.parametrize(("data", "options"), [each[1:] for each in frames()],
                         ids=[each[0] for each in frames()])  # fmt: skip
def test_frames_are_recordings(data, options):
    (made,) = make_recordings(data, **options)
    assert made.states == ("q", "dq") and np.array_equal(made.values, X)
    assert np.allclose(made.time, TIME, atol=1e-9)


def test_rows_of_a_part_of_a_frame_are_no_times():
    part = frame().reset_index(drop=True)[125:]
    with pytest.raises(ValueError, match="t: is missing"):
        make_recordings(part)
    (made,) = make_recordings(part, TIME[125:])
    assert np.array_equal(made.values, X[125:])


def test_frames_of_polars_and_xarray_are_recordings():
    polars, xarray = pytest.importorskip("polars"), pytest.importorskip("xarray")
    table = polars.DataFrame({"t": TIME, "q": X[:, 0], "dq": X[:, 1]})
    array = xarray.DataArray(X, {"time": TIME, "state": STATES}, ("time", "state"))
    data = array.to_dataset("state").assign_coords(site=3)
    for each in (table, array, data):
        assert make_recordings(each) == [Recording(TIME, STATES, X)]
    (one,) = make_recordings(table, u="dq")
    assert one.states == ("q",) and np.array_equal(one.inputs["dq"].values, X[:, 1])
    assert len(make_recordings([data, data])) == 2


def test_arrays_are_recordings():
    (made,) = make_recordings(X.tolist(), 1 / 40)
    assert made.states == ("x0", "x1") and np.allclose(made.time, TIME)
    (one,) = make_recordings(X[:, 0], TIME, FORCE, X[:, 1], states=["q"])
    assert one.values.shape == (1200, 1) and np.array_equal(one.rates[:, 0], X[:, 1])
    assert [*one.inputs] == ["u0"] and one.inputs["u0"].between == "cubic"
    (held,) = make_recordings(X, TIME, FORCE, inputs=["F"], between="zero")
    assert held.inputs["F"].between == "zero"


def test_several_recordings():
    parts = [X[:500], X[500:]]
    steps = make_recordings(parts, 1 / 40)
    own = make_recordings(parts, [TIME[:500], TIME[500:]], [FORCE[:500], FORCE[500:]], parts)
    assert [len(one.time) for one in steps] == [500, 700] and steps[1].time[0] == 0
    assert own[1].time[0] == TIME[500] and np.array_equal(own[1].rates, X[500:])
    assert np.array_equal(own[1].inputs["u0"].values, FORCE[500:])
    assert make_recordings([frame(), frame()], u=["dq"])[1].inputs.keys() == {"dq"}


def test_columns_are_chosen_by_name_else_renamed():
    (one,) = make_recordings(frame(), states=["dq"])
    assert one.states == ("dq",) and np.array_equal(one.values[:, 0], X[:, 1])
    (two,) = make_recordings(frame(), states=["a", "da"])
    assert two.states == ("a", "da") and np.array_equal(two.values, X)


@pytest.mark.parametrize(
    ("x", "options", "what"),
    [
        (X, {}, "t: is missing"),
        (pd.DataFrame(X), {}, "t: is missing"),
        (X, {"t": -0.1}, "t: -0.1"),
        (X, {"t": TIME[:-1]}, "t: has shape"),
        (X, {"t": 0.1, "states": ["q"]}, "x: has 2 columns"),
        (X, {"t": 0.1, "u": FORCE[:-1]}, "u: u0: values"),
        (X, {"t": 0.1, "u": FORCE, "inputs": ["F", "G"]}, "u: has 1 columns"),
        (X, {"t": 0.1, "u": {"F": "strong"}}, "u: F: text"),
        (X[None], {"t": 0.1}, "x: has shape"),
        ("motion.csv", {}, "x: text"),
        (frame(), {"u": "F"}, "u: no column 'F'"),
        (frame(), {"t": "when"}, "t: no column 'when'"),
        ([X, X], {"t": 0.1, "u": FORCE}, "u: must be a list of 2"),
        ([X, X[:, :1]], {"t": 0.1, "x_dot": [X, X]}, "recording 1: x_dot: has 2 columns"),
        (Recording(TIME, STATES, X), {"t": 0.1}, "t, u, x_dot"),
    ],
)
def test_what_does_not_fit_is_named(x, options, what):
    with pytest.raises(ValueError, match=r"^[^\n]*$") as raised:
        make_recordings(x, **options)
    assert str(raised.value).startswith(what)


# --- as scikit-learn expects ---


def test_it_is_an_estimator(duffing):
    with pytest.raises(galloping.NotFittedError, match="not fitted"):
        MaximumLikelihood().predict(X)
    check_is_fitted(duffing)
    with pytest.raises(NotFittedError):
        check_is_fitted(MaximumLikelihood())
    options = duffing.get_params()
    assert options["feature_names"] is STATES
    fresh = clone(duffing)
    assert fresh.get_params() == options and not hasattr(fresh, "model_")
    assert fresh.set_params(degree=2) is fresh and fresh.degree == 2
    assert repr(fresh) == "MaximumLikelihood(degree=2, feature_names=['q', 'dq'])"
    with pytest.raises(ValueError, match="degre: no option"):
        fresh.set_params(degre=2)
    copied = pickle.loads(pickle.dumps(duffing))
    assert copied.model_ == duffing.model_ and copied.get_params() == options
    assert set(duffing.feature_names_in_) == {"q", "dq"} and duffing.n_features_in_ == 2


# --- containers out, figures ---


def test_answers_are_frames(duffing):
    motion = MOTION.to_frame()
    assert motion.index.name == "t" and [*motion] == STATES
    assert [*galloping.Trajectory(TIME, X, "ok").to_frame()] == ["x0", "x1"]
    ahead = galloping.forecast(duffing.model_, duffing.recordings_[0])
    table = ahead.to_frame()
    assert [*table] == ["q", "q_low", "q_high", "dq", "dq_low", "dq_high"]
    assert np.array_equal(table.index, ahead.time) and np.all(table.q_low < table.q_high)
    for window in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="window: "):
            galloping.forecast(duffing.model_, duffing.recordings_[0], window=window)
    assert galloping.assess(duffing.model_).to_frame().what.eq("rest").any()


def test_models_are_latex_in_notebooks(duffing):
    text = duffing._repr_latex_()
    assert text.startswith("$$") and text.endswith("$$") and r"\dot q" in text
    assert rf"\text{{{duffing.model_.status}}}" in text
    assert DUFFING.latex() in DUFFING._repr_latex_()


def test_figures_in_one_call(duffing, driven):
    pictures = [galloping.plot_fit(duffing), galloping.plot_fit(driven.model_, driven.recordings_),
                galloping.plot_forecast(duffing), galloping.plot_phase(duffing)]  # fmt: skip
    assert all(isinstance(each, Figure) and each.axes for each in pictures)
    phase = pictures[-1].axes[0]
    assert (phase.get_xlabel(), phase.get_ylabel()) == ("q", "dq")
    samples, motion = (line.get_xydata() for line in phase.get_lines())
    assert np.array_equal(samples, X) and np.abs(motion - MOTION.states).max() < 0.1
    assert pictures[-1]._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="states: "):
        galloping.plot_phase(duffing, states=["q"])
    with pytest.raises(ValueError, match="found: a Recording"):
        galloping.plot_fit(duffing.recordings_[0])
    bare = [replace(one, inputs={}) for one in driven.recordings_]
    for call, recordings, message in (
        (galloping.plot_fit, duffing.recordings_, "have the states q, dq; the model has y"),
        (galloping.plot_phase, bare, "lack the input F"),
        (galloping.plot_forecast, bare, "lack the input F"),
    ):
        with pytest.raises(ValueError, match=message):
            call(driven.model_, recordings)


# --- pages ---


@pytest.mark.slow
def test_the_measurement_beside_pysindy_is_that_of_its_script():
    # as the script says: sums of several threads round differently from run to run
    done = run(ROOT, "examples/beside_pysindy.py", "van der Pol", OPENBLAS_NUM_THREADS="1")
    assert done.returncode == 0, done.stdout
    page = (ROOT / "docs" / "beside_pysindy.md").read_text(encoding="utf-8")
    header, *rows, _ = done.stdout.splitlines()  # the last has times
    table = [line for line in page.splitlines() if line.startswith("| van der Pol |")]
    assert header in page and len(rows[1:]) == len(table) == 3
    for row, line in zip(rows[1:], table, strict=True):
        for ours, shown in zip(row.split("|"), line.split("|"), strict=True):
            (count, _, error), (right, _, stated) = ours.partition(","), shown.partition(",")
            assert count == right
            if error:
                assert float(error.split()[0]) == pytest.approx(float(stated.split()[0]), rel=0.1)
