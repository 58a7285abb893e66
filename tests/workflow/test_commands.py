"""What the commands of the Makefile refuse and show before they do it."""

import shutil
import subprocess
import sys
from dataclasses import asdict

import pytest
from studies import script

from galloping.reproducibility.receipts import Receipt, receipt_path
from galloping.storage import write_json


@pytest.mark.parametrize("cores", ["0", "1.5"])
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
    status, said = script(folder, "keep_results", "prune", *options)
    assert status == 0 and said[0] == path and old.exists()
    assert said[1] == "results/smoke: 1 left over files, 0.0 MB, to be removed by DELETE=yes"
    status, said = script(folder, "keep_results", "prune", "--delete", *options)
    assert status == 0 and said[0].split() == [path, str(receipt_path(path)), log]
    assert not old.exists()
    status, said = script(folder, "keep_results", "prune", *options)
    assert (status, said) == (
        0, ["results/smoke: nothing is left over; the settings ask for every result"]
    )  # fmt: skip


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (None, "config/config.yaml: No such file or directory"),
        ("measurement: {replicates: many}\n", "measurement.replicates: 'many' is text"),
    ],
    ids=["missing", "wrong"],
)
def test_plain_snakemake_says_of_a_bad_configuration_what_make_says(root, tmp_path, content, line):
    (tmp_path / "workflow").symlink_to(root / "workflow")
    (tmp_path / "config").mkdir()
    if content is not None:
        (tmp_path / "config" / "config.yaml").write_text(content, encoding="utf-8")
    status, made = script(tmp_path, "run_study")
    assert status == 1 and made[0].startswith(line)
    command = [sys.executable, "-m", "snakemake", "-n", "--workflow-profile", "none"]
    run = subprocess.run(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        check=False,
    )  # fmt: skip
    assert run.returncode != 0 and run.stdout.splitlines() == made, run.stdout
    assert {path.name for path in tmp_path.iterdir()} <= {"workflow", "config", ".snakemake"}
