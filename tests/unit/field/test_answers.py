"""What odd files and wrong commands are answered: the right numbers, or the right cause."""

import errno
import json
import os
import re
import signal
import subprocess
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from click.testing import CliRunner
from field_files import COMMAND, MAP, SPAN, run
from odd_files import DOUBTED, NOTED, READ, REFUSED, TIME, UNITS, V, W, lines, table, written

from galloping import IdentifiedModel, PolynomialModel
from galloping.cli import main
from galloping.summary import OUTPUTS, analysis


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """The model of the motion of the odd files."""
    path = tmp_path_factory.mktemp("model") / "model.json"
    line = PolynomialModel(("q_v", "dq_v"), ((0, 1), (1, 0)), [[1.0, 0.0], [0.0, -6.76]])
    IdentifiedModel(
        line, known=(0,), standard_errors=[[np.nan] * 2, [np.nan, 0.001]],
        initial_states=[[0.0, 2.6]], sigma=[[0.01, np.nan]],
    ).save(path)  # fmt: skip
    return path


def recorded(path):
    """A file of the vertical motion with a little noise, and the options that read it."""
    noisy = V + 0.01 * np.random.default_rng(1).standard_normal(len(V))
    path.write_text(lines(v=noisy))
    return path, "--states", "q_v,dq_v", "--measure", "q_v=v", *UNITS


def inspected(tmp_path, name, content, options):
    """The arguments that inspect an odd file."""
    if name.endswith(".xlsx"):
        pytest.importorskip("openpyxl")
    return "inspect", written(tmp_path / name, content), *options


@pytest.mark.parametrize("name", READ)
def test_what_can_be_read_is_read_right(tmp_path, name):
    report = json.loads(run(*inspected(tmp_path, name, *READ[name]), "--json"))
    assert report["sampling"]["samples"] == 1000
    assert report["sampling"]["rate_hz"] == pytest.approx(25)
    for values, channel in zip((V, W), report["channels"].values(), strict=True):
        assert channel["dominant_frequencies_hz"] == [pytest.approx(0.4138, abs=0.02)]
        assert channel["standard_deviation"] == pytest.approx(values.std(), rel=0.01)
        assert channel["highest"] == pytest.approx(values.max(), rel=0.01)


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_cause(tmp_path, name):
    *odd, said = REFUSED[name]
    printed = run(*inspected(tmp_path, name, *odd), code=1)
    assert len([line for line in printed.splitlines() if " is read as " not in line]) == 1
    assert [part for part in said if part not in printed] == [], printed


@pytest.mark.parametrize("name", DOUBTED)
def test_what_is_unlikely_is_found(tmp_path, name):
    content, options, *doubt = DOUBTED[name]
    report = json.loads(run(*inspected(tmp_path, name, content, options), "--json"))
    assert doubt in [[each["column"], each["row"], each["code"]] for each in report["problems"]]


@pytest.mark.parametrize("name", NOTED)
def test_what_is_left_out_or_taken_for_something_is_noted(tmp_path, name):
    *odd, said = NOTED[name]
    printed = CliRunner().invoke(main, list(map(str, inspected(tmp_path, name, *odd)))).output
    assert [part for part in said if part not in printed] == [], printed


def test_a_mapping_is_proposed_to_be_checked_and_then_used(tmp_path):
    path = written(tmp_path / "a.csv", table("t [s],z,y,x [m]", TIME, V, W, W))
    map_file = tmp_path / "map.yaml"
    said = CliRunner().invoke(main, ["inspect", str(path), "--write-map", str(map_file)])
    assert said.exit_code == 0
    doubts = [line.partition(" in ")[0] for line in said.output.splitlines()[1:]]
    assert doubts == ["Check 'z'", "Check 'y'"] and "the file says no unit" in said.output
    assert "does not say what it measures" in run("inspect", path, code=1)
    assert "columns 'z', 'y' have no unit" in run("inspect", path, "--map", map_file, code=1)
    map_file.write_text(map_file.read_text().replace("null", "m"))
    assert "z measures q_v" in run("inspect", path, "--map", map_file)
    assert "map.yaml: exists" in run("inspect", path, "--write-map", map_file, code=1)
    other = ("--write-map", tmp_path / "b.yaml", "--measure", "q_v=z")
    assert "and --decimal; not --measure" in run("inspect", path, *other, code=1)
    plain = written(tmp_path / "b.csv", lines("t [s];vertical [m];horizontal [m]", ";", ","))
    said = run("inspect", plain, "--write-map", tmp_path / "plain.yaml")
    assert said == run("inspect", plain, "--map", tmp_path / "plain.yaml") == run("inspect", plain)


def test_an_earlier_output_is_kept_unless_it_is_to_be_replaced(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    earlier = {"summary.md": b"of a year ago", "model.json": b"{}", "notes.txt": b"mine"}
    for name, content in earlier.items():
        (out / name).write_bytes(content)

    def there():
        return {path.name: path.read_bytes() for path in out.iterdir()}

    command = ("identify", *recorded(tmp_path / "a.csv"), "--method", "weak_gls", "--output", out)
    assert f"{out}: holds an earlier summary.md" in run(*command, code=1)
    assert there() == earlier
    run(*command, "--replace")
    after = there()
    assert after.keys() == {*OUTPUTS, "notes.txt"}
    assert earlier.items() & after.items() == {("notes.txt", b"mine")}


@pytest.mark.parametrize("output", ["a.csv/out", "/proc/out"])
def test_an_output_that_cannot_be_written_is_refused_first(tmp_path, output):
    said = run("identify", *recorded(tmp_path / "a.csv"), "--output", tmp_path / output, code=1)
    assert f"{tmp_path / output}: cannot be written: " in said and said.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_a_disk_that_is_full_at_last_leaves_nothing(tmp_path, monkeypatch):
    full = OSError(errno.ENOSPC, "No space left on device")
    monkeypatch.setattr(analysis, "write_figures", Mock(side_effect=full))
    command = ("identify", *recorded(tmp_path / "a.csv"), "--method", "weak_gls", "--output")
    *before, last = run(*command, tmp_path / "new" / "out", code=1).splitlines()
    assert "out: " in last and full.strerror in last
    assert all("done" in line for line in before)  # how far it is, if it is slow
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize(
    ("cause", "code", "text"),
    [(KeyboardInterrupt(), 130, "Interrupted\n"), (SystemExit(143), 143, "")],
)
def test_a_signal_inside_compiled_code_ends_the_command(monkeypatch, model, cause, code, text):
    error = SystemError("returned a result with an exception set")
    error.__cause__ = cause
    monkeypatch.setattr(IdentifiedModel, "load", Mock(side_effect=error))
    assert run("show", model, code=code) == text


@pytest.mark.parametrize(
    ("sent", "code", "last"),
    [(signal.SIGTERM, 128 + signal.SIGTERM, []), (signal.SIGINT, 130, ["Interrupted"])],
)
def test_an_identification_that_is_ended_leaves_nothing(tmp_path, sent, code, last):
    process = subprocess.Popen(
        [*COMMAND, "identify", SPAN, *MAP, "--output", tmp_path / "out"],
        stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert any("% done" in line for line in process.stderr)  # in the midst of it
    assert any(tmp_path.iterdir())
    process.send_signal(sent)
    _, said = process.communicate()
    assert process.returncode == code and said.splitlines()[-1:][: len(last)] == last
    assert not any(tmp_path.iterdir())


def test_a_forecast_from_too_few_samples_is_refused(tmp_path, model):
    command = ("forecast", model, *recorded(tmp_path / "a.csv"), "--duration", 1)
    assert len(run(*command).splitlines()) == 26
    told = CliRunner().invoke(main, [str(each) for each in command])
    assert "unjudged" in told.stderr  # no forecast is printed without the status of its model
    said = run(*command, "--window", 0.01, code=1)
    assert "0.01 s" in said and "1 samples" in said
    assert "--window 1e+09: must be 1,000,000 steps of" in run(*command, "--window", 1e9, code=1)


def test_a_simulation_of_any_length_comes_row_by_row(model):
    command = [*COMMAND, "simulate", model, "--rate", "9000", "--duration", "1000000"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    head = [next(process.stdout) for _ in range(150_000)]  # more than a piece
    process.stdout.close()
    process.wait()
    times, q = np.loadtxt(head[1:], delimiter=",", usecols=(0, 1)).T
    np.testing.assert_allclose(np.diff(times), 1 / 9000, atol=2e-8)
    assert np.abs(np.diff(q)).max() < 2.7 / 9000  # it goes on where a piece ends


def test_json_is_json(model, tmp_path):
    def refuse(name):
        pytest.fail(f"{name} is not JSON")

    rows = json.loads(run("show", model, "--json"), parse_constant=refuse)
    assert rows[0]["standard_error"] is None and rows[1]["standard_error"] == 0.001
    found = IdentifiedModel.load(model)
    growing = replace(found.model, coefficients=[[1.0, 0.0], [1.0, -6.76]])
    path = str(tmp_path / "model.json")
    replace(found, model=growing).save(path)
    ends = CliRunner().invoke(main, ["simulate", path, "--initial", "1,9", "--json"])
    assert ends.exit_code == 1 and "diverged" in ends.stderr
    assert len(json.loads(ends.stdout, parse_constant=refuse)) < 7501
    assert "exclude each other" in run("show", model, "--json", "--latex", code=2)


NO_COVARIANCE = b'"covariance": []'
NO_MODEL = [  # what is in the file, and what the one line says
    (lambda _: b"", "not an identified model"),
    (lambda _: b"[]", "must be a mapping of keys"),
    (lambda _: b'{"states": ["x"]}', "no key 'inputs'"),
    (lambda _: b"\xff", "not an identified model"),
    (lambda model: model.replace(b"-6.76", b"NaN"), "not all are finite"),
    (lambda model: model.replace(b"-6.76", b'"nan"'), "not all are finite"),
    (lambda model: model.replace(b"-6.76", b'"inf"'), "not all are finite"),
    (lambda model: model.replace(b"-6.76", b"1e300"), "not all are finite and below 1e+100"),
    (lambda model: model.replace(NO_COVARIANCE, b'"covariance": [[1, 0], [0, 1]]'), "of 2 terms"),
    (lambda model: model.replace(NO_COVARIANCE, b'"covariance": [["nan"]]'), "must be finite"),
    (lambda model: model.replace(NO_COVARIANCE, b'"covariance": [[-1]]'), "negative variances"),
    (lambda _: b"[" * 100_000, "not an identified model"),
    (lambda model: model.replace(b'"dq_v"', b'"q\\n**ok**"'), "must be names that print"),
    (lambda model: model.replace(b'"dq_v"', b'"q_v"'), "a name is there twice"),
    (lambda model: re.sub(rb"\[\s*0,\s*1\s*\]", b"[0, 9e99]", model), "must be whole numbers"),
    (lambda model: re.sub(rb"\[\s*0,\s*1\s*\]", b"[0, -1]", model), "must be 0 or more"),
    (lambda model: re.sub(rb'"known": \[[^]]*\]', b'"known": [7]', model), "of equations 0 to 1"),
    (lambda model: model.replace(b'"unjudged"', b'"approximate"'),
     "status: 'approximate' contradicts the findings (none), from which 'ok' follows"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "said"), NO_MODEL)
def test_a_file_that_is_no_model_is_named(tmp_path, model, content, said):
    path = tmp_path / "model.json"
    assert f"{path}: No such file" in run("show", path, code=1)
    path.write_bytes(content(model.read_bytes()))
    printed = run("show", path, code=1)
    assert f"{path}: " in printed and said in printed and printed.count("\n") == 1


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_standard_output_is_named(model, unbuffered):
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [*COMMAND, "show", str(model)], stdout=full, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )  # fmt: skip
    assert ended.stderr == "Error: standard output: No space left on device\n"
    assert ended.returncode == 1
