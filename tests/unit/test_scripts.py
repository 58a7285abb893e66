"""Scripts are functions, which can be called without Snakemake."""

import importlib.util
import re
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

from galloping.reproducibility import job
from galloping.study.files import read

ROOT = Path(__file__).parents[2]
RULES = "".join(path.read_text("utf-8") for path in (ROOT / "workflow" / "rules").glob("*.smk"))
NAMES = sorted(set(re.findall(r'"\.\./scripts/(\w+)\.py"', RULES)))


def script(name):
    """The function of a script, which has the script's name."""
    path = ROOT / "workflow" / "scripts" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)


def named(rule, section):
    """The names that a rule gives in one of its sections, and the wildcards of its outputs."""
    text = re.search(rf"^rule {rule}:\n(.*?)(?=^\S|\Z)", RULES, re.MULTILINE | re.DOTALL)[1]
    found = re.search(rf"^    {section}:\n(.*?)(?=^    \w)", text, re.MULTILINE | re.DOTALL)
    body = found[1] if found else ""
    return set(re.findall(r"^        (\w+)=", body, re.MULTILINE)), body


@pytest.mark.parametrize("name", NAMES)
def test_a_script_takes_what_its_rule_names(name):
    (inputs, _), (outputs, written), (params, _) = (
        named(name, section) for section in ("input", "output", "params")
    )
    parameters = signature(script(name)).parameters
    takes = {each for each, of in parameters.items() if of.kind != of.VAR_KEYWORD}
    given = inputs | outputs | (params - {job.CODE})
    assert outputs and given <= takes
    needed = {each for each in takes - given if parameters[each].default is parameters[each].empty}
    assert needed <= set(re.findall(r"{(\w+)}", written))  # wildcards, where they are asked for


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
