"""Which cells a study has, what is in its files, and scripts as functions without Snakemake."""

import runpy

import numpy as np
import pytest
from lines import CASES, edited
from PIL import Image

from galloping.configuration.load import load
from galloping.results import Motion
from galloping.study import files
from galloping.study.cells import Study, drop_swept_parameters


def study(**settings):
    return Study(load(settings))


DEFAULT = study()


def test_the_cells_of_the_default_study():
    assert len(DEFAULT.cells) == 2 * 3 * (6 + 4) + 3
    cell = DEFAULT.cell("non_resonant", "state", "joint_0.05")
    assert (cell.kind, cell.recordings, cell.samples, cell.level) == ("joint", 2, 30001, 0.05)
    assert DEFAULT.cell("non_resonant", "state", "points_1000").samples == 1000
    families = DEFAULT.cell("internal_resonance", "state", "noise_0").families
    assert {name: len(methods) for name, methods in families.items()} == {
        "sparse": 5, "likelihood": 2,
    }  # fmt: skip
    assert "weak" not in [m.name for m in DEFAULT.cells[0].methods]  # exact states need none


def test_without_noise_replicates_are_one_and_draw_nothing():
    cell, seeded = (
        of.cell("internal_resonance", "state", "noise_0")
        for of in (DEFAULT, study(measurement={"seed": 5}))
    )
    assert (cell.replicates, cell.seed, cell.relative) == (1, 0, False)
    assert seeded.measurement == cell.measurement


def test_more_replicates_of_a_trial_are_further_batches():
    def batches(replicates):
        trial = {"kind": "sensor_faults", "cases": ["late channels"], "replicates": replicates}
        return {batch.name: batch for batch in study(trials={"a": trial}).trials[0].batches}

    few, more = batches(20), batches(25)
    assert list(few) == ["late_channels_0_to_9", "late_channels_10_to_19"]
    assert few == {name: more[name] for name in few}
    assert set(more) - set(few) == {"late_channels_20_to_24"}
    assert list(more["late_channels_20_to_24"].replicates) == [20, 21, 22, 23, 24]


def test_the_trials_of_an_exam_have_one_table():
    trials = {"a": {"kind": "systems"}, "b": {"kind": "ambient"}, "c": {"kind": "files"}}
    assert [each.table for each in study(trials=trials).trials] == [
        "systems",
        "model_error",
        "exam",
    ]
    assert {each.table for each in study(trials=trials, exam=True).trials} == {"exam"}


def test_a_file_is_read_as_its_place_says(tmp_path):
    motion = Motion(("a", "b"), np.arange(3.0), np.eye(3)[:, :2], np.ones((3, 2)), "ok")
    path = tmp_path / "trajectories" / "line.npz"
    files.write_trajectories(path, [motion, motion])
    read = files.read_all({"one": path, "many": [path], "none": []}, {"many": ["x"], "none": []})
    assert read["none"] == {}
    for motions in (read["one"], read["many"]["x"]):
        assert len(motions) == 2 and motions[0].names == ("a", "b")
        assert np.array_equal(motions[1].states, motion.states)
    with pytest.raises(ValueError, match="is of no kind that a study has"):
        files.read(tmp_path / "trajectories" / "line.txt")


def test_noise_that_looks_like_percent_is_questioned_in_one_line():
    for asked in ({"levels": [0, 1, 3, 5]}, {"subsets": {"level": 5}}):
        (doubt,) = study(measurement=asked).doubts
        assert "write 0.05" in doubt
    assert not DEFAULT.doubts
    for other in ({"state_noise": "absolute"}, {"protocols": ["derivative"]}):
        assert not study(measurement={"levels": [1, 3]} | other).doubts


def test_a_sweep_does_not_read_what_it_varies():
    line = DEFAULT.cases[0].released
    told = drop_swept_parameters(line, "wind_speed", "tension", None, "span")
    assert "speed" not in told["wind"] and "tension" not in told["line"]
    assert told["line"]["span"] == line["line"]["span"]  # its spacers move with it
    ratios = drop_swept_parameters(line, "damping_ratio")
    assert ratios["damping"] == {} and ratios["initial_state"] == line["initial_state"]


@pytest.fixture
def script(root):
    """From the name of a script to its function, which has this name."""
    folder = root / "workflow" / "scripts"
    return lambda name: runpy.run_path(str(folder / f"{name}.py"))[name]


def test_from_a_line_to_recordings_without_snakemake(script, tmp_path):
    names = ("models/a.json", "trajectories/a.npz", "recordings/a/state/c.npz")
    model, trajectory, recordings = (tmp_path / name for name in names)
    script("derive_model")(CASES["non_resonant"], model)
    releases = [{"q_v": 0.1, "q_w": 0.2, "dq_v": 0.0, "dq_w": 0.0}]
    script("simulate_line")(model, trajectory, releases, duration=20, sampling_rate=50)
    measurement = {
        "protocol": "state", "level": 0.05, "relative": True, "samples": 1001, "recordings": 1,
        "replicates": 2, "seed": 1,
    }  # fmt: skip
    script("measure_motion")("a", "state", "c", trajectory, recordings, measurement)
    (motion,), ((first,), (second,)) = files.read(trajectory), files.read(recordings)
    assert motion.states[0].tolist() == [0.1, 0.2, 0.0, 0.0]
    noise = (first.values - motion.states).std(axis=0) / motion.states.std(axis=0)
    assert np.allclose(noise, 0.05, rtol=0.2)
    assert not np.array_equal(first.values, second.values)


@pytest.mark.parametrize(
    ("wind", "scale", "duration", "status", "n_frames"),
    [(3, 1.0, 4, "ok", 41), (100, 1.0, 30, "diverged", 1), (3, 0.0, 4, "ok", 1)],
)
def test_any_line_has_an_animation(script, tmp_path, wind, scale, duration, status, n_frames):
    case = edited(CASES["internal_resonance"], wind__speed=wind)
    names = ("models/a.json", "trajectories/a.npz", "figures/a.gif")
    model, trajectory, animation = (tmp_path / name for name in names)
    script("derive_model")(case, model)
    release = {name: scale * value for name, value in case["initial_state"].items()}
    script("simulate_line")(model, trajectory, [release], duration, sampling_rate=50)
    assert files.read(trajectory)[0].status.startswith(status)
    script("animate_line")(animation, "a", trajectory, case, window=[2, duration])
    with Image.open(animation) as image:
        assert image.n_frames == n_frames  # ten a second


def test_a_line_is_assessed_without_snakemake(script, tmp_path):
    names = ("clearance.csv", "measures.csv", "assessment/a/orbits.npz")
    clearance, measures, orbits = (tmp_path / name for name in names)
    script("assess_line")(
        "a", [], clearance, measures, orbits, CASES["internal_resonance"], winds=[2.0],
        design_wind=12.0, phase_distance=[3.0, 4.0], limit=1.0,
        chosen={"tight": {"kind": "tension", "factor": 1.2}}, seed=1,
    )  # fmt: skip
    assert list(files.read(orbits)) == [12.0]  # at 2 m/s the line comes to rest
    assert set(files.read(clearance)["case"]) == set(files.read(measures)["case"]) == {"a"}
