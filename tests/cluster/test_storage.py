"""A cell of the smoke study whose results are in a storage, each job in a folder of its own.

Nothing but the storage is shared, as on Kubernetes or in a cloud's batch service.
"""

import shutil
import sys
from pathlib import Path

import pytest
from studies import CONFIGURATION, copy_repository, run, script

from galloping.reproducibility.receipts import RECEIPT_SUFFIX

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

TARGETS = (
    "results/smoke/scores/non_resonant/state/noise_0.05.csv",
    "results/smoke/tables/table1_conductor.csv",  # made by the main process: reads a file of git
)
SUBMIT = """#!/bin/sh
node=$(mktemp -d {folder}/node.XXXXXX)
cp -r {folder}/image $node/clone
cp "$1" $node/job.sh
cd $node/clone
(sh ../job.sh > ../said.log 2>&1; echo $? > ../status) > /dev/null 2>&1 &
echo $node
"""
STATUS = """#!/bin/sh
case "$(cat "$1/status" 2> /dev/null)" in "") echo running;; 0) echo success;; *) echo failed;; esac
"""
RSYNC = """#!/bin/sh
while [ $# -gt 2 ]; do shift; done
exec cp -Lp "$1" "$2"
"""  # which copies single files as the plugin for storage asks rsync to, where there is none


@pytest.fixture
def folder(root, tmp_path):
    """Of the repository as a node gets it, of scripts, and of the storage."""
    copy_repository(root, tmp_path / "image")
    shutil.copytree(tmp_path / "image", tmp_path / "main", symlinks=True)
    scripts = {"submit": SUBMIT.format(folder=tmp_path), "status": STATUS}
    if not shutil.which("rsync"):
        scripts["rsync"] = RSYNC
    for place in ("bin", "storage"):
        (tmp_path / place).mkdir()
    for name, text in scripts.items():
        (tmp_path / "bin" / name).write_text(text)
        (tmp_path / "bin" / name).chmod(0o755)
    return tmp_path


def test_a_study_runs_in_a_storage_and_without_a_shared_file_system(study, folder, monkeypatch):
    pytest.importorskip("snakemake_executor_plugin_cluster_generic", reason="run `make tools`")
    pytest.importorskip("snakemake_storage_plugin_fs", reason="run `make tools`")
    assert study.first.returncode == 0, study.first.stdout
    places = (folder / "bin", Path(sys.executable).parent)  # jobs call the first `python`
    monkeypatch.setenv("PATH", ":".join(map(str, places)), prepend=":")
    command = (
        *("-m", "snakemake", *TARGETS, "--configfile", CONFIGURATION),
        *("--workflow-profile", "none", "--executor", "cluster-generic", "--jobs", "1"),
        *("--cluster-generic-submit-cmd", folder / "bin" / "submit"),
        *("--cluster-generic-status-cmd", folder / "bin" / "status"),
        *("--seconds-between-status-checks", "1", "--default-storage-provider", "fs"),
        *("--default-storage-prefix", folder / "storage", "--shared-fs-usage", "none"),
    )
    done = run(folder / "main", *command, PYTHONPATH="")
    logs = "\n".join(path.read_text() for path in folder.glob("node.*/said.log"))
    assert done.returncode == 0, done.stdout + logs
    again = run(folder / "main", *command, "--dry-run", PYTHONPATH="")
    assert "Nothing to be done" in again.stdout, again.stdout
    assert not (folder / "main" / "results" / "smoke").exists()

    stored = folder / "storage" / "results" / "smoke"
    receipts = list(stored.rglob(f".*{RECEIPT_SUFFIX}"))
    files = [path.with_name(path.name[1 : -len(RECEIPT_SUFFIX)]) for path in receipts]
    assert len(files) > 5
    for path in files:
        assert path.read_bytes() == (study.results / path.relative_to(stored)).read_bytes(), path

    fetched = shutil.copytree(folder / "image", folder / "fetched", symlinks=True)
    shutil.copytree(stored, fetched / "results" / "smoke")
    _, said = script(fetched, "keep_results", "verify", "--configfile", CONFIGURATION)
    assert any(line.startswith(f"results/smoke: {len(files)} files verified, ") for line in said)
