"""Scripts are functions, which can be called without Snakemake."""

import importlib.util
from pathlib import Path

import numpy as np

from galloping.study.files import read

ROOT = Path(__file__).parents[2]


def script(name):
    """The function of a script, which has the script's name."""
    path = ROOT / "workflow" / "scripts" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)


def test_from_a_line_to_recordings_without_snakemake(cases, tmp_path):
    model, trajectory, recordings = (
        tmp_path / name
        for name in ("models/a.json", "trajectories/a.npz", "recordings/a/state/c.npz")
    )
    line = cases["non_resonant"]
    script("derive_model")(line, model)
    releases = [{"q_v": 0.1, "q_w": 0.2, "dq_v": 0.0, "dq_w": 0.0}]
    script("simulate_line")(model, trajectory, releases, duration=20, sampling_rate=50)
    measurement = {
        "protocol": "state", "level": 0.05, "relative": True, "samples": 1001, "recordings": 1,
        "replicates": 2, "seed": 1,
    }  # fmt: skip
    script("measure_motion")("a", "state", "c", trajectory, recordings, measurement)
    (motion,), ((first,), (second,)) = read(trajectory), read(recordings)
    assert motion.states[0].tolist() == [0.1, 0.2, 0.0, 0.0]
    noise = (first.values - motion.states).std(axis=0) / motion.states.std(axis=0)
    assert np.allclose(noise, 0.05, rtol=0.2)
    assert not np.array_equal(first.values, second.values)
