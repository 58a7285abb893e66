"""Files of known truth: the motions obey their equations, and what is said of them is judged."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from studies import run

from galloping.identification.findings import Code
from galloping.streams import make_generator
from galloping.summary.analysis import FieldQuestion, identify_field
from galloping.summary.sample_files import FILES, Oscillation, judge, trial, write_and_read

MODE = Oscillation(3.0, 0.05)


def test_a_free_motion_obeys_its_equation_from_its_release_on():
    time = np.linspace(-1.0, 5.0, 601)
    x, dx, ddx = (MODE.free(time, 0.2, derivative) for derivative in range(3))
    np.testing.assert_allclose(ddx, MODE.rates[1] @ [x, dx], atol=1e-12)
    np.testing.assert_allclose(np.gradient(x, time)[105:-1], dx[105:-1], atol=1e-3)
    assert x[100] == pytest.approx(0.2) and dx[100] == pytest.approx(0.0, abs=1e-12)
    assert not np.any(x[:100])


def test_a_driven_motion_is_free_without_a_force_and_rests_at_a_steady_one():
    free = MODE.driven(np.zeros(500), 0.01, start=0.2)
    np.testing.assert_allclose(free, MODE.free(0.01 * np.arange(500), 0.2), atol=1e-12)
    steady = MODE.driven(np.full(10000, 1.8), 0.01)
    assert steady[-1] == pytest.approx(1.8 / MODE.frequency**2)


def sample(case, replicate=0):
    return FILES[case](make_generator(11, "file", case, replicate))


@pytest.mark.parametrize("case", FILES)
def test_a_file_is_drawn_by_number_and_can_be_read(case):
    one, again, other = sample(case), sample(case), sample(case, 1)
    for header, values in one.columns.items():
        np.testing.assert_array_equal(values, again.columns[header])
    assert one.mode == again.mode != other.mode
    field = write_and_read(one)
    assert len(field.recordings) == 1
    assert field.mapping.states == tuple(one.mapping["states"])


def test_what_is_said_of_a_file_is_judged():
    known = sample("decay to rest")
    _, said = identify_field(write_and_read(known), FieldQuestion())
    row = judge(known, said)
    assert said.found.status == "ok" and row["exact_support"] and not row["ok_and_wrong"]
    assert row["coverage"] == 1.0 and np.isnan(row["fault_diagnosed"])
    assert judge(replace(known, cause=Code.KNOCKED), said)["fault_diagnosed"] == 0.0
    slower = replace(known, mode=Oscillation(0.99 * known.mode.frequency, known.mode.damping))
    assert judge(slower, said)["coverage"] == 0.5
    without_equation = replace(slower, equation="")
    row = judge(without_equation, said)
    assert row["ok_and_wrong"] and "exact_support" not in row


def test_a_file_is_identified_as_by_the_command():
    row = next(trial(11, "limit cycle in micrometres", [0], {"maximum_likelihood": {}}))
    assert (row["case"], row["replicate"], row["status"]) == ("limit cycle in micrometres", 0, "ok")
    assert row["exact_support"] and not row["ok_and_wrong"] and row["work"] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "written"),
    [("record_line", "span"), ("record_gusts", "gusts"), ("record_ambient", "ambient")],
)
def test_example_recordings_are_those_of_their_scripts(root, tmp_path, script, written):
    shutil.copy(root / "examples" / f"{script}.py", tmp_path)
    done = run(tmp_path, f"{script}.py", OPENBLAS_NUM_THREADS="1")
    assert done.returncode == 0, done.stdout
    made, kept = (
        pd.read_csv(folder / f"{written}.csv") for folder in (tmp_path, root / "examples")
    )
    pd.testing.assert_frame_equal(made, kept, atol=1.01, rtol=0)  # mm; rounding of processors
