"""The library as a user meets it: names, examples, what it takes and what it says of the rest."""

import ast
import copy
import doctest
import math
import pickle
import tomllib
from dataclasses import replace
from importlib import import_module
from inspect import getmembers, isfunction, signature
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from sklearn.utils import Tags
from studies import run

import galloping
from galloping import Recording
from galloping.arrays import Immutable
from galloping.identification.findings import Code, Finding

ROOT = Path(__file__).parents[2]
TIME = np.arange(200) / 20
VALUES = np.column_stack([np.sin(TIME), np.cos(TIME)])
TERMS = galloping.polynomial_library(2, 1)
LINE = galloping.PolynomialModel(("q", "dq"), TERMS, np.array([[0, 0, 1.0], [0, -1.0, 0]]))
FOUND = galloping.IdentifiedModel(LINE, is_judged=True, diagnostics={"told": math.nan})
TYPES = {  # imported where they are made
    "Trajectory": galloping.Trajectory, "Figure": Figure, "DataFrame": pd.DataFrame, "Tags": Tags,
}  # fmt: skip
DATES = np.datetime64("2026-01-30T10:00") + (1000 * TIME).astype("timedelta64[ms]")


def recording(**changes):
    return Recording(**{"time": TIME, "states": ("q", "dq"), "values": VALUES} | changes)


def test_the_examples_of_the_library_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed, tried = doctest.testmod(galloping)
    assert tried > 15 and failed == 0


def test_the_library_has_one_version_and_needs_no_package_of_the_study():
    """What `pip install .` brings is enough for every public name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert galloping.__version__ == project["version"]
    study = ["pandas", "matplotlib", "pysindy", "sklearn", "snakemake", "psutil", "rocrate"]
    assert not any(name in text for text in project["dependencies"] for name in study)
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({study!r}))\n"
        "import galloping; [getattr(galloping, name) for name in galloping.__all__]; "
        "galloping.MaximumLikelihood().get_params()"
    )
    done = run(ROOT, "-c", code)
    assert done.returncode == 0, done.stdout


def test_lists_arrays_and_frames_are_the_same_recording():
    frame = pd.DataFrame({"t": TIME, "q": VALUES[:, 0], "dq": VALUES[:, 1]})
    for other in (
        recording(time=TIME.tolist(), states=["q", "dq"], values=VALUES.tolist()),
        recording(time=frame["t"], values=frame[["q", "dq"]]),
        Recording.from_frame(frame, time="t"),
        Recording.from_frame(frame.set_index("t")),
        Recording.from_frame({"s": TIME, "q": VALUES[:, 0], "dq": VALUES[:, 1]}, time="s"),
    ):
        assert other.states == ("q", "dq")
        assert np.array_equal(other.time, TIME)
        assert np.array_equal(other.values, VALUES)
    missing = Recording.from_frame(frame.astype({"q": object}).replace({"q": {0.0: None}}))
    assert np.isnan(missing.values[0, 0])
    masked = np.ma.masked_greater(VALUES, 0.9)
    assert recording(values=masked) == recording(values=np.where(VALUES > 0.9, np.nan, VALUES))


def test_dates_become_seconds():
    day = pd.DatetimeIndex(DATES)
    frame = pd.DataFrame(VALUES, columns=["q", "dq"], index=day)
    for other in (
        Recording.from_frame(frame),
        Recording.from_frame(frame.tz_localize("Europe/Berlin")),
        Recording.from_frame(frame.reset_index(names="t")),
        recording(time=day),
        recording(time=day - day[0]),
        recording(time=day.to_pydatetime()),
        recording(time=list(day.tz_localize("UTC").to_pydatetime())),
    ):
        assert other == recording(time=DATES)
        assert np.allclose(other.time, TIME)


def test_what_is_printed_says_what_it_is_in_a_few_lines():
    gap = np.where(np.arange(200)[:, None] < 20, np.nan, VALUES)
    rates = np.column_stack([np.full(200, np.nan), VALUES[:, 0]])
    assert repr(recording(values=gap, rates=rates)) == (
        "Recording of q, dq\n"
        "200 samples from 0 to 9.95 s, every 0.05 s\n"
        "measured: q (10 % missing), dq (10 % missing), ddq"
    )
    equations = "d(q)/dt = 1 dq\nd(dq)/dt = -1 q"
    assert repr(LINE) == f"PolynomialModel of q, dq, 3 candidate terms\n{equations}"
    assert repr(FOUND) == f"IdentifiedModel of q, dq\n{equations}\nok"
    assert repr(MOTION) == "Trajectory: 200 samples of 2 states from 0 to 9.95 s, ok"


def test_equal_things_are_equal_and_have_one_hash(tmp_path):
    found = galloping.weak_gls(recording(), TERMS)
    found.save(tmp_path / "found.json")
    for one, same, other in (
        (found, galloping.IdentifiedModel.load(tmp_path / "found.json"), replace(found, chi2=9.0)),
        (FOUND, pickle.loads(pickle.dumps(FOUND)), FOUND.with_findings(Finding.of(Code.NO_TERM))),
        (LINE, copy.deepcopy(LINE), replace(LINE, coefficients=2 * LINE.coefficients)),
        (recording(), recording(values=VALUES.tolist()), recording()[:100]),
        (MOTION, galloping.Trajectory(TIME, VALUES, "ok"), ENDED),
    ):
        assert one == same and hash(one) == hash(same)
        assert one != other and one != 3
        assert len({one, same, other}) == 2


def test_nothing_changes_afterwards():
    given = VALUES.copy()
    recorded = recording(values=given)
    given[:] = 0.0
    assert np.array_equal(recorded.values, VALUES)
    copied = pickle.loads(pickle.dumps(FOUND))
    for array in (
        recorded.values, recorded.time, recorded[:50].values, LINE.coefficients,
        copied.model.coefficients, copied.standard_errors, copied.covariance, MOTION.states,
    ):  # fmt: skip
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 1.0
    with pytest.raises(TypeError):
        copied.diagnostics["told"] = 1.0


def test_signatures_hold_no_address_and_real_types():
    for name in galloping.__all__[1:]:
        public = getattr(galloping, name)
        functions = [own for of, own in getmembers(public, isfunction) if of not in vars(Immutable)]
        for called in [public] if isfunction(public) else functions:
            assert " at 0x" not in str(signature(called)), called
            if called.__module__.startswith("galloping"):
                hints = get_type_hints(called, vars(import_module(called.__module__)) | TYPES)
                assert np.ndarray not in hints.values(), called


def test_type_checkers_see_what_is_there():
    package = Path(galloping.__file__).parent
    assert (package / "py.typed").exists()
    stub = ast.parse((package / "__init__.pyi").read_text())
    names = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    [exported] = [node.value for node in stub.body if isinstance(node, ast.Assign)]
    assert {"__version__", *names} == set(galloping.__all__) == set(ast.literal_eval(exported))
    for name, (module, there) in names.items():
        assert getattr(galloping, name) is getattr(import_module(module), there)
    assert set(galloping.__all__) <= set(dir(galloping))
    with pytest.raises(AttributeError, match="no attribute 'recordng'"):
        _ = galloping.recordng


INF = np.where(np.isclose(VALUES, VALUES[3, 0]), np.inf, VALUES)
MOTION = galloping.Trajectory(TIME, VALUES, "ok")
ENDED = galloping.Trajectory(TIME, VALUES, "diverged: far away")


fits, likely = galloping.weak_gls, galloping.maximum_likelihood


# Calls, of which those of `fits` are tried with `likely` too, and how the line that answers begins.
REFUSED = """
recording(time=["a"] * 200) | recording: time: text; must be real numbers
recording(time=3) | recording: time: has shape (); must have shape (n,)
recording(time=TIME[::-1]) | recording: {BAD_TIME}; row 1 has
recording(time=[0, 1, 1, 2]) | recording: {BAD_TIME}; row 2 has 1 after 1
recording(time=[0, math.nan]) | recording: {BAD_TIME}
recording(time=np.where(TIME[1] == TIME, NOT_A_TIME, DATES)) | recording: time: no time in row 1
recording(values=VALUES * 1j) | recording: values: complex numbers; must be real numbers
recording(values=VALUES > 0) | recording: values: truth values; must be real numbers
recording(values=INF) | recording: values: inf in row 3 of q; must be finite, or NaN
recording(values=VALUES.T) | recording: values: has shape (2, 200); {SHAPE}
recording(values=[[1, 2], [3]]) | recording: values: rows differ in length; {SHAPE}
recording(values=None) | recording: values: has shape (); {SHAPE}
recording(values=pd.DataFrame(VALUES, columns=["dq", "q"])) | recording: values: columns ('dq', 'q')
recording(rates=pd.DataFrame(VALUES, columns=["x", "y"])) | recording: rates: columns ('x', 'y')
recording(states="qd") | recording: states: 'qd'; must be a list of names
recording(known_noise=[0.1]) | recording: known_noise: has shape (1,); must have shape (2, 2)
recording(exact=True) | recording: exact: True; must be False without rates
recording(unknown_scales=[0.1]) | recording: unknown_scales: [0.1]; must be a truth value a state
recording(states=("q", "q")) | recording: states: ('q', 'q'); must be distinct, one or more
framed(s=[0, 1], q=[0, 1]) | recording: no column 't'; must be one of ['s', 'q']
framed(t=[0, 1], q=[0, 1, 2]) | recording: columns differ in length
fits([], TERMS) | recordings: is empty; {WANTED}
fits(pd.DataFrame(VALUES), TERMS) | recordings: a DataFrame; {WANTED} (Recording.from_frame takes
fits(VALUES.tolist(), TERMS) | recordings: item 0 is a list; {WANTED}
fits([recording(), "x"], TERMS) | recordings: item 1 is a str; {WANTED}
fits([recording(), OTHER], TERMS) | recordings: item 1 has the states a, b; must have those of
fits([recording(), DRIVEN], TERMS) | recordings: item 1 repeats samples of item 0 from its sample 0
fits(SHORT, TERMS) | recordings: 10 samples are fewer than the 100 needed
fits(PAUSED, TERMS) | recordings: item 0 has a gap of 1e+06 s between samples 0.05 s apart; must
fits(recording(), galloping.polynomial_library(3, 1)) | terms: (0, 0, 0); must be tuples of 2
fits(recording(), (1, 0)) | terms: 1; must be tuples of 2
fits(recording(), TERMS, LINE, ("x",)) | known_states: 'x'; must be among q, dq
fits(recording(), TERMS, None, ("dq",)) | known_states: dq; needs `known`, their equations
fits(recording(), TERMS, LINE, LINE.states) | the equations of q, dq are all known; none is left
likely(recording(), TERMS, prior=0.1) | prior: a float; must be a Prior or None
likely(recording(), TERMS, forced=("x",)) | random force: 'x'; must be among q, dq
likely(recording(), TERMS, coefficients=[known("q")]) | coefficients: 'q'; must be an unknown
likely(recording(), TERMS, coefficients=[known("dq", (0, 2))]) | coefficients: dq^2: not in the
likely(recording(), TERMS, coefficients=None) | coefficients: None; must be a list of Coefficient
likely([DRIVEN, recording()], GUSTY.terms) | recordings: item 1 lacks the input U of the first
likely(DRIVEN, GUSTY.terms) | terms: (0, 3, -1); U is 0 in a recording
known("dq", [1, 0]) | coefficient: term: [1, 0]; must be a tuple of exponents
known("dq", (1, 0), lower=0.0, upper=None) | coefficient: lower, upper: 0.0, None; must be numbers
known("dq", (1, 0), -1) | coefficient: deviation: -1; must be a number from 0 up to 1e+100
galloping.Prior(term=0.0) | prior: term: 0.0; {ODDS}
galloping.Prior(nonlinear="small") | prior: nonlinear: 'small'; {ODDS}
galloping.Input([0, 1], [1, math.nan]) | input: values: fewer than two are there
galloping.Input([0, 0], [1, 2]) | input: {BAD_TIME}
galloping.Input([0, 1], [1, math.inf]) | input: values: inf; must be finite
galloping.Input([0, 1], [1, 2], "smooth") | input: between: 'smooth'; must be zero, linear, cubic
galloping.Input([0, 1], [1, 2], "zero", 1.0) | input: error: 1.0; must be a number in [0, 1)
Recording.from_frame({"t": [0, 1]}, inputs=["V"]) | recording: inputs: no column 'V'; there is ['t']
recording(inputs={"q": U}) | recording: inputs: 'q'; must be a name of no state
GUSTY.at({"V": 1.0}) | V: no input; the model has the inputs U
GUSTY.at({"U": 0.0}) | U: 0; dq^3/U is not finite there
GUSTY.at({"U": "2"}) | U: '2'; must be a finite number
GUSTY([[0.1, 0.0]]) | u: not there; the model is driven by U
LINE([0.1, 0.0]) | x: has shape (2,); must have shape (n, 2)
LINE.jacobian(VALUES, VALUES) | u: has shape (200, 2); must have shape (200, 0)
galloping.simulate(GUSTY, [0.1, 0.0], TIME, {"U": CALM}) | inputs: U: 0; dq^3/U is not finite there
galloping.simulate(GUSTY, [0.1, 0.0], TIME, {"U": "2"}) | inputs: U: a str; must be Input or number
Recording.from_frame(pd.DataFrame({"q": []}, pd.DatetimeIndex([]))) | recording: {BAD_TIME}
galloping.simulate(GUSTY, [0.1, 0.0], TIME) | inputs: U: not there; the model is driven by it
galloping.simulate(LINE, [0, 1], TIME, {"U": 3}) | inputs: U: no input of the model, which has none
galloping.simulate(GUSTY, [0.1, 0.0], TIME + 1.0, {"U": U}) | inputs: U: not there at 10 s
galloping.PolynomialModel(("a",), ((1,), (2,)), [[0]]) | coefficients: shape (1, 1), expected (1, 2)
galloping.PolynomialModel("a", ((-1,),), [[1]]) | terms: (-1,); {WHOLE}
galloping.PolynomialModel("a", ((0.5,),), [[1]]) | terms: (0.5,); {WHOLE}
galloping.PolynomialModel("a", ((1, 0.5),), [[1]], "u") | terms: (1, 0.5); {WHOLE}
galloping.PolynomialModel("a", ((1,), (1,)), [[1, 2]]) | terms: a: is there twice; must be distinct
galloping.PolynomialModel("aa", ((1, 0),), [[1], [1]]) | states, inputs: a, a; must be distinct
galloping.MaximumLikelihood().fit([[1, 2], [3]], t=0.1) | x: rows differ in length; must have equal
LINE.on_library(((1, 0),)) | term dq is not in the library
NONE.simulate([0.0, 0.0], [0.0, 1.0]) | there is no model to simulate: No model was found.
galloping.polynomial_library(2, -1) | degree: -1; must be a whole number >= 0
galloping.simulate(LINE, [0, 0, 0], TIME) | initial_state: 3 numbers for the 2 states q, dq
FOUND.simulate([0], TIME) | initial_state: {ONE}
galloping.simulate(LINE, [0, math.inf], TIME) | initial_state: [0.0, inf]; must be finite
galloping.simulate(LINE, [0, 1], [0, math.inf]) | {BAD_TIME}
galloping.cramer_rao_bound(LINE, [0, 1], [1, 0], [1, 1]) | {BAD_TIME}
galloping.forecast(LINE, recording()) | found: a PolynomialModel; {IDENTIFIED}
galloping.forecast(FOUND, OTHER) | recordings: have the states a, b; the model has q, dq
galloping.summarise(FOUND, recording(), method="stlsq") | method: 'stlsq'; {METHODS}
galloping.forecast(FOUND, recording(), [9.95, 10]) | time: begins at 9.95 s; the recording ends
galloping.simulate("line", [0, 1], TIME) | model: a str; {MODEL}
galloping.cramer_rao_bound(power(2), [1], [0, 2], [1]) | the solution of the model diverges
galloping.cramer_rao_bound(power(1), [0], [0, 200, 400], [1]) | the sensitivity of the motion
galloping.cramer_rao_bound(LINE, [0, 1], TIME, [1, 0]) | sigma: [1.0, 0.0]; each must be > 0
galloping.measure(LINE, VALUES) | motion: a ndarray; must be what `simulate` returns
galloping.measure(LINE, ENDED) | motion: diverged: far away; there is nothing to measure
galloping.measure(LINE, MOTION, protocol="stat") | protocol: 'stat'; {PROTOCOLS}
galloping.measure(LINE, MOTION, level=5) | level: 5 is noise of 500 % of the motion; 5 % is 0.05
galloping.measure(LINE, MOTION, level=-1) | level: -1; must be >= 0
galloping.measure(LINE, MOTION, seed=-1) | seed: -1; must be a whole number >= 0
galloping.parse_model(None) | text: None; must be text
galloping.derive(simulation={}, cases={}) | cases: is a key of a study; must be a key of one case
galloping.derive(wind={"speed": 1000}) | wind.speed: 1000 is not allowed; must be 0.1..120 m/s
"""
ENDINGS = {
    "BAD_TIME": "time: must be finite, strictly increasing, two samples or more",
    "ODDS": "must be a number in (0, 1]",
    "SHAPE": "must have shape (200, 2)",
    "WHOLE": "exponents must be whole numbers, those of states >= 0",
    "WANTED": "must be a Recording, or a list of recordings of one system",
    "ONE": "1 numbers for the 2 states q, dq; none for dq",
    "IDENTIFIED": "must be an IdentifiedModel, such as `maximum_likelihood` returns",
    "METHODS": "must be one of maximum_likelihood, weak_gls",
    "MODEL": "must be a PolynomialModel, such as `derive` returns",
    "PROTOCOLS": "must be one of derivative, state, displacement, acceleration",
}
NOT_A_TIME = np.datetime64("NaT")
SHORT = Recording(TIME[:10], ("q", "dq"), VALUES[:10])
PAUSED = Recording(np.append(TIME, 1e6 + TIME), ("q", "dq"), np.tile(VALUES, (2, 1)))
OTHER = recording(states=("a", "b"))
NONE = galloping.IdentifiedModel.refused(LINE.states, TERMS, [])
U = galloping.Input(TIME, np.cos(TIME))
CALM = galloping.Input(TIME, np.zeros(200))
DRIVEN = recording(inputs={"U": U})
GUSTY = galloping.PolynomialModel(
    LINE.states, ((1, 0, 0), (0, 1, 0), (0, 3, -1)), [[0, 1, 0], [-4, 0.1, -0.9]], ("U",)
)
ROWS = [row.split(" | ") for row in REFUSED.strip().splitlines()]
ROWS += [[c.replace("fits", "likely"), answer] for c, answer in ROWS if c.startswith("fits")]


def framed(**columns):
    return Recording.from_frame(columns)


def power(degree):
    return galloping.PolynomialModel(("x",), ((degree,),), [[1.0]])


def known(equation, term=(0, 1), deviation=0.0, **bounds):
    return galloping.Coefficient(equation, term, 1.0, deviation, **bounds)


@pytest.mark.parametrize(("call", "answer"), ROWS)
def test_other_input_is_one_clear_line(call, answer):
    with pytest.raises(ValueError) as error:
        eval(call)
    said = str(error.value)
    assert said.startswith(answer.format(**ENDINGS)) and "\n" not in said
