"""Plucks, blows and decays as technicians record them, by the command."""

import json

import numpy as np
import pytest
from field_files import run
from swings import noisy, small_motions, swing

from galloping import IdentifiedModel
from galloping.identification.findings import Code


def written(folder, header, *columns):
    path = folder / "decay.csv"
    np.savetxt(path, np.column_stack(columns), "%.7g", ",", header=header, comments="")
    return path


def test_a_blow_of_a_few_seconds_is_told_by_an_accelerometer(tmp_path):
    time = np.arange(1000) / 200.0
    blow = 300.0 * np.exp(-(((time - 1.0) / 0.004) ** 2))
    acceleration = swing(time - 1.0, 8.0, 0.01, 0.004, 2) + blow
    path = written(tmp_path, "t [s],acc [m/s^2]", time, noisy(acceleration, 1, 1e-4))
    out = tmp_path / "out"
    run("identify", path, "--states", "q,dq", "--measure", "ddq=acc", "--output", out)
    found = IdentifiedModel.load(out / "model.json")
    assert found.status == "ok" and [one.code for one in found.findings] == [Code.RELEASED]
    assert found.findings[0].data["time_s"] == pytest.approx(1.0, abs=0.1)
    assert small_motions(found) == pytest.approx((8.0, 0.01), rel=2e-3)


def test_a_pluck_by_a_sensor_of_coarse_steps_is_no_jump_of_its_zero(tmp_path):
    time, step = np.arange(2400) / 40.0, 5e-4
    motion = np.where(time < 5.0, 0.05, swing(time - 5.0, 1.0, 0.015, 0.05))
    samples = step * np.round(noisy(motion, 2, 0.004) / step)
    path, out = written(tmp_path, "t [s],x [m]", time, samples), tmp_path / "out"
    run("identify", path, "--states", "q,dq", "--measure", "q=x", "--output", out)
    found = IdentifiedModel.load(out / "model.json")
    assert found.status == "ok"
    assert {one.code for one in found.findings} == {Code.RELEASED, Code.CAME_TO_REST}
    assert not json.loads((out / "quality.json").read_text(encoding="utf-8"))[0]["problems"]


def test_what_comes_to_rest_is_not_stuck(tmp_path):
    time, resolution = np.arange(1200) / 200.0, 0.09
    size = np.maximum(1.0 - time / 2.0, 0.0)  # of dry friction
    angle = resolution * np.round(60.0 * size * np.cos(9.3 * time) / resolution)
    path = written(tmp_path, "t [s],angle [deg]", time, angle)
    asked = "inspect", path, "--states", "q,dq", "--measure", "q=angle"
    said = run(*asked)
    assert "stuck" not in said and "nothing moves" in said
    assert "no gaps" in said
    stuck = np.where(time > 0.5, angle[100], angle)  # amid its swing
    others = written(tmp_path, "t [s],angle [deg],b [deg]", time, stuck, angle + 0.5 * time)
    both = "--states", "q,p,dq,dp", "--measure", "q=angle", "--measure", "p=b"
    assert "stuck" in run("inspect", others, *both)


def test_a_decay_into_the_noise_ends_once(tmp_path):
    time = np.arange(4000) / 20.0
    path = written(tmp_path, "t [s],x [m]", time, noisy(swing(time, 1.0, 0.005), 3, 0.006))
    run("identify", path, "--states", "q,dq", "--measure", "q=x", "--output", tmp_path / "out")
    found = IdentifiedModel.load(tmp_path / "out" / "model.json")
    assert [one.code for one in found.findings] == [Code.CAME_TO_REST]
