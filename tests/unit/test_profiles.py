"""The profile of the cluster names every rule, and agrees with the default one where they share."""

import re

import pytest
import yaml

OF_A_MACHINE = {"cores"}


@pytest.fixture
def profiles(root):
    folder = root / "workflow" / "profiles"
    return {
        name: yaml.safe_load((folder / name / "config.yaml").read_text(encoding="utf-8"))
        for name in ("default", "slurm")
    }


@pytest.fixture
def rules(root):
    files = (root / "workflow" / "rules").glob("*.smk")
    texts = [file.read_text(encoding="utf-8") for file in files]
    found = {name for text in texts for name in re.findall(r"^rule (\w+):", text, re.MULTILINE)}
    assert len(found) >= 9
    return found


def test_every_rule_has_resources_and_a_group_on_the_cluster(profiles, rules):
    assert set(profiles["slurm"]["set-resources"]) == rules
    assert set(profiles["slurm"]["groups"]) == rules
    assert set(profiles["slurm"]["group-components"]) == set(profiles["slurm"]["groups"].values())


def test_every_attempt_asks_for_more(profiles):
    for rule, resources in profiles["slurm"]["set-resources"].items():
        assert set(resources) == {"mem_mb", "runtime"}, rule
        for value in resources.values():
            assert eval(value, {"attempt": 2}) > eval(value, {"attempt": 1}) > 0, rule


def test_profiles_agree_where_they_share(profiles):
    shared = profiles["default"].keys() - OF_A_MACHINE
    assert shared
    assert {key: profiles["slurm"].get(key) for key in shared} == {
        key: profiles["default"][key] for key in shared
    }
