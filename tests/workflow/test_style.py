"""The repository's own style: formatted, and without a remark from any linter."""

import subprocess
import sys

import pytest


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
