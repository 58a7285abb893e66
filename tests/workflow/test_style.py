"""The repository's own style: formatted, and without a remark from any linter."""

import pytest
import yaml
from studies import run


@pytest.mark.parametrize(
    "command",
    [
        ("ruff", "check", "--no-cache"),
        ("ruff", "format", "--check", "--no-cache"),
        ("snakefmt", "--check", "Snakefile", "workflow/Snakefile", "workflow/rules"),
        ("snakemake", "--lint"),
    ],
    ids=["ruff-check", "ruff-format", "snakefmt", "snakemake-lint"],
)
def test_style(root, command):
    done = run(root, "-m", *command)
    assert done.returncode == 0, done.stdout


def test_the_profiles_agree_and_that_for_slurm_names_every_rule(fresh):
    listed = fresh.snakemake("--list-rules", "--quiet", "all")
    assert listed.returncode == 0, listed.stdout
    default, slurm = (
        yaml.safe_load((fresh.folder / f"workflow/profiles/{name}/config.yaml").read_text())
        for name in ("default", "slurm")
    )
    rules = set(slurm["groups"])
    assert rules == set(slurm["set-resources"])
    assert rules | {"all"} == {line for line in listed.stdout.splitlines() if line.isidentifier()}
    shared = default.keys() & slurm.keys() - {"cores"}
    assert len(shared) > 3 and {key: default[key] for key in shared} == {
        k: slurm[k] for k in shared
    }
