"""The repository's own style: formatted, and without a remark from any linter."""

import subprocess
import sys

import pytest
import yaml


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
    run = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout


def test_the_profiles_agree_and_that_for_slurm_names_every_rule(fresh):
    run = fresh.snakemake("--list-rules", "--quiet", "all")
    assert run.returncode == 0, run.stdout
    default, slurm = (
        yaml.safe_load((fresh.folder / f"workflow/profiles/{name}/config.yaml").read_text())
        for name in ("default", "slurm")
    )
    rules = set(slurm["groups"])
    assert rules == set(slurm["set-resources"])
    assert rules | {"all"} == {line for line in run.stdout.splitlines() if line.isidentifier()}
    shared = default.keys() & slurm.keys() - {"cores"}
    assert len(shared) > 3 and {key: default[key] for key in shared} == {
        k: slurm[k] for k in shared
    }
