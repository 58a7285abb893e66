"""What the commands of the Makefile refuse and show before they do it."""

import shutil
from dataclasses import asdict

import pytest
from studies import Study, run, script

from galloping.reproducibility.receipts import Receipt, receipt_path
from galloping.storage import write_json, write_text


@pytest.mark.parametrize("cores", ["0", "1.5"])
def test_a_number_of_cores_that_is_none_is_one_line(root, cores):
    assert script(root, "run_study", "--cores", cores) == (
        1,
        [f"CORES: {cores!r} is not a number of cores; must be all or a whole number >= 1"],
    )


@pytest.mark.slow
def test_pruning_shows_what_it_would_remove(fresh, tmp_path):
    study = Study(tmp_path / "study")
    shutil.copytree(fresh.folder, study.folder, ignore=shutil.ignore_patterns(".snakemake"))
    path, log = (f"results/smoke/{name}" for name in ("scores/old.csv", "logs/old.log"))
    write_text(study.folder / path, "1\n")
    write_text(study.folder / log, "")
    made = Receipt(path, "evaluate_cell", {}, log, {}, {}, "0" * 64, size=2, seconds=1.0)
    write_json(study.folder / receipt_path(path), asdict(made))
    told = "results/smoke: 1 left over files, 0.0 MB, to be removed by DELETE=yes"
    assert study.keep("prune") == (0, [path, told]) and (study.folder / path).exists()
    status, (removed, *_) = study.keep("prune", "--delete")
    assert status == 0 and not (study.folder / path).exists()
    assert removed.split() == [path, str(receipt_path(path)), log]
    status, (said,) = study.keep("prune")
    assert status == 0 and "nothing is left over" in said


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
    plain = run(tmp_path, "-m", "snakemake", "-n", "--workflow-profile", "none")
    assert plain.returncode != 0 and plain.stdout.splitlines() == made, plain.stdout
    assert {path.name for path in tmp_path.iterdir()} <= {"workflow", "config", ".snakemake"}
