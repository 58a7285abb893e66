"""What the commands of the Makefile refuse and show before they do it."""

import os
import shutil
import subprocess
import sys
from dataclasses import asdict

import pytest

from galloping.reproducibility.receipts import Receipt, receipt_path
from galloping.storage import write_json


def script(folder, name, *options):
    run = subprocess.run(
        [sys.executable, f"workflow/scripts/{name}.py", *options],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder / "workflow" / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return run.returncode, run.stdout.splitlines()


def test_an_environment_that_is_a_link_is_refused_and_its_target_left_alone(root, tmp_path):
    clone, theirs = tmp_path / "clone", tmp_path / "theirs"
    clone.mkdir()
    theirs.mkdir()
    (theirs / "file").touch()
    for name in ("Makefile", "requirements.lock"):
        shutil.copy(root / name, clone)
    (clone / ".venv").symlink_to(theirs)
    command = ["make", "--no-print-directory", f"PYTHON={sys.executable}"]
    run = subprocess.run(command, cwd=clone, capture_output=True, text=True)
    assert run.returncode != 0
    assert run.stdout == (
        ".venv is a link, and the environment would be made in the folder that it points to: "
        "remove the link, and run again\n"
    )
    assert [path.name for path in theirs.iterdir()] == ["file"]


@pytest.mark.parametrize("cores", ["abc", "0", "-1", "1.5", ""])
def test_a_number_of_cores_that_is_none_is_one_line(root, cores):
    assert script(root, "run_study", "--cores", cores) == (
        1,
        [f"CORES: {cores!r} is not a number of cores; must be all or a whole number >= 1"],
    )


@pytest.mark.slow
def test_pruning_shows_what_it_would_remove(fresh, tmp_path):
    folder = tmp_path / "study"
    shutil.copytree(fresh.folder, folder, ignore=shutil.ignore_patterns(".snakemake"))
    path, log = (f"results/smoke/{name}" for name in ("scores/old.csv", "logs/old.log"))
    old = folder / path
    old.parent.mkdir(parents=True)
    old.write_text("1\n")
    (folder / log).parent.mkdir()
    (folder / log).touch()
    made = Receipt(path, "evaluate_cell", {}, log, {}, {}, "0" * 64, size=2, seconds=1.0)
    write_json(folder / receipt_path(path), asdict(made))
    options = ("--configfile", "config/smoke.yaml")
    status, said = script(folder, "prune_results", *options)
    assert status == 0 and said[0] == path and old.exists()
    assert said[1] == "results/smoke: 1 left over files, 0.0 MB, to be removed by DELETE=yes"
    status, said = script(folder, "prune_results", "--delete", *options)
    assert status == 0 and said[0].split() == [path, str(receipt_path(path)), log]
    assert not old.exists()
