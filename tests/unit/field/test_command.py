"""The command, from the example of a monitored span to its forecast."""

import csv
import json
import re
import runpy

import numpy as np
import pytest
from click.testing import CliRunner
from field_files import EXAMPLES, MAP, SPAN, run
from lines import RESONANT

from galloping import IdentifiedModel, Simulator, derive
from galloping.cli import main
from galloping.cycles.family import critical_wind
from galloping.cycles.settling import settle
from galloping.storage import write_text
from galloping.summary import OUTPUTS

pytestmark = pytest.mark.xdist_group("examples")

LIMIT_CYCLE = {"q_v": 1.125, "q_w": 2.215}  # m, of the continuous line after 1500 s


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    folder = tmp_path_factory.mktemp("span")
    run("identify", SPAN, *MAP, "--output", folder)
    return folder


def test_the_example_gives_the_limit_cycle_of_the_span(example):
    assert sorted(path.name for path in example.iterdir()) == sorted(OUTPUTS)
    identified = IdentifiedModel.load(example / "model.json")
    assert identified.status in ("ok", "not identifiable", "approximate")
    time = np.arange(0, 1500, 0.05)
    motion = identified.simulate(identified.initial_states[0], time).states[-4000:]
    for k, state in enumerate(LIMIT_CYCLE):
        assert np.ptp(motion[:, k]) / 2 == pytest.approx(LIMIT_CYCLE[state], rel=0.05)
    summary = (example / "summary.md").read_text(encoding="utf-8")
    assert identified.verdict in summary
    shown = re.findall(r"^> (.*)$", (EXAMPLES.parent / "README.md").read_text(), re.MULTILINE)
    assert " ".join(shown) in " ".join(summary.split())
    with (example / "forecast.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert all(float(row["q_v_low"]) < float(row["q_v_high"]) for row in rows)


def of_the_modes(summary):
    """The sections of a summary without what the command alone knows: columns and their places."""
    without = re.sub(r"\| \S+ of \S+, .* at its sensor \|.*\n", "", summary)
    return without.replace(" of the first mode", "").split("## ")


@pytest.mark.slow
def test_python_says_what_the_command_says(example, capsys):
    runpy.run_path(str(EXAMPLES / "from_python.py"))
    parts = of_the_modes(capsys.readouterr().out)
    summary = (example / "summary.md").read_text(encoding="utf-8")
    whole = of_the_modes(summary)
    assert len(summary.splitlines()) - len("## ".join(whole).splitlines()) == 8  # columns
    assert [part for part in parts[:-1] if part[:10] != "Recordings"] == [
        part for part in whole[:-1] if part[:10] != "Recordings"
    ]
    assert parts[-1].startswith(whole[-1].rstrip())
    assert "limit cycle of q_v: 1.1" in parts[-1]


def test_with_the_wind_recorded_the_model_holds_at_other_winds(tmp_path):
    gusts = tmp_path / "out"
    files = EXAMPLES / "gusts.csv", "--map", EXAMPLES / "gusts.yaml"
    said = CliRunner().invoke(main, ["identify", *map(str, files), "--output", str(gusts)]).output
    assert "columns that are not used: air" in said
    model = gusts / "model.json"
    assert IdentifiedModel.load(model).status == "ok"
    summary = (gusts / "summary.md").read_text(encoding="utf-8")
    assert "input U is not known for" in summary and "U, its mean" in summary
    assert "From a speed below the mean of U, 12 m/s." in summary
    figure = gusts / "winds.png"
    rows = json.loads(run("assess", model, "--at", "U=4:14:5", "--json", "--figure", figure))
    assert (
        figure.read_bytes()[:4] == b"\x89PNG"
        and "amplitude, m" in figure.with_suffix(".svg").read_text()
    )
    for wind in (9.0, 14.0):
        line = derive(wind={"speed": wind})
        true = settle(Simulator(line.states, line.terms), line, [0.2, 0.1, 0, 0]).half_range
        for k, state in enumerate(("q_v", "q_w")):
            (said,) = (row for row in rows if row["U"] == wind and row["stable"]
                       and row["quantity"] == f"half range of {state}")  # fmt: skip
            assert said["value"] == pytest.approx(true[k], rel=0.02)
    (onset,) = (row for row in rows if row["what"] == "onset")
    assert onset["low"] < critical_wind(RESONANT)
    assert onset["value"] == pytest.approx(5.25, rel=0.05)


def test_derive_prints_the_equations_of_a_case(tmp_path):
    write_text(tmp_path / "case.yaml", "wind: {speed: 14}\n")
    printed = json.loads(run("derive", tmp_path / "case.yaml", "--json"))
    line = derive(wind={"speed": 14})
    assert printed["dq_v"]["q_v"] == line.coefficients[2, line.term_names.index("q_v")]


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--states", "q_v", "--measure", "q_v=av150"], 1, "unit 'm/s^2'"),
        (["--states", "v150", "--measure", "v150"], 1, "expected STATE=COLUMN"),
        (["--states", "v150", "--noise", "x=3"], 1, "--noise: no column 'x'"),
        (["--states", "v150", "--delay", "x=3"], 1, "--delay: no column 'x'"),
        (["--states", "v150", "--delay", "v150=late"], 1, "delay: 'late'"),
        ([*MAP, "--noise", "v150=3"], 1, "--map stands alone"),
        (["--states", "q_v", "--measure", "q_v=v150", "--noise", "v150=3 s"], 1,
         "noise of column 'v150': unit 's'"),
        (["--states", "v150", "--delay", "v150=1", "--delay", "v150=2"], 1, "one for each column"),
        (["--unit", ""], 2, "Invalid value for '--unit': must not be empty"),
        (["--states", ""], 2, "Invalid value for '--states': must not be empty"),
        (["--unit", "v150="], 1, "must be one for each column, COLUMN=VALUE"),
        (["--decimal", ",,"], 2, "',,' is not one of '.', ','"),
        (["--duration", "3"], 2, "No such option"),
    ],
)  # fmt: skip
def test_errors_are_one_line(arguments, code, said):
    printed = run("inspect", SPAN, *arguments, code=code)
    assert said in printed
    assert code == 2 or len(printed.splitlines()) == 1


def test_a_refused_model_and_a_broken_mapping_are_told_in_one_line(tmp_path):
    refused = IdentifiedModel.refused(("q", "dq"), ((1, 0), (0, 1)), [])
    refused.save(tmp_path / "model.json")
    write_text(tmp_path / "map.yaml", "states: [q\n")
    write_text(tmp_path / "case.yaml", "wind: {speed: 14}\nwind: {speed: 15}\n")
    for says, *options in (
        ("holds no model", "forecast", tmp_path / "model.json", SPAN),
        ("holds no model", "simulate", tmp_path / "model.json"),
        ("map.yaml:2: ", "inspect", SPAN, "--map", tmp_path / "map.yaml"),
        ("case.yaml:2: ", "derive", tmp_path / "case.yaml"),
    ):
        output = run(*options, code=1)
        assert says in output and output.count("\n") == 1
