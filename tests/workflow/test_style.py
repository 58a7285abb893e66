"""The repository's own style: formatted, and without a remark from any linter."""

import re
import subprocess
import sys
from pathlib import Path

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


# --- pages ---


ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_pages_are_whole(tmp_path):
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", tmp_path / "cache"]
    run = subprocess.run(
        [*build, ROOT / "docs", tmp_path / "pages"],
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT / "workflow/src")},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    pages = sorted((tmp_path / "pages").glob("*.html"))
    assert len(pages) > 15
    for page in pages:
        for kind, target in re.findall(r'(href|src)="([^"#?]+)', page.read_text()):
            if target.startswith(("http", "mailto")):
                assert kind == "href", f"{page.name} loads {target}"
            else:
                assert (page.parent / target).exists(), f"{page.name}: {target}"
    summary = (tmp_path / "pages" / "tutorial_recording.html").read_text()
    assert "limit cycle" in summary
