"""What the table of faults in docs/running.md says: a study is harmed, told, and whole again.

Each fault has a copy of one finished smoke study, of which some results are taken away so that a
few jobs run.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import time

import psutil
import pytest

from galloping.reproducibility.receipts import digest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("copies")]

SMOKE = ("--configfile", "config/smoke.yaml")
REPAIR = "`make repair CONFIG=config/smoke.yaml`"
FIGURES = [f"figures/{name}.svg" for name in ("figure05", "figure06", "figure07", "overview")]
PATIENCE = 600  # seconds


class Harmed:
    """A copy of a finished study, and the commands on it."""

    def __init__(self, study, folder):
        self.study = study.copied(folder)
        self.folder, self.results = folder, self.study.results
        self.sound = contents(self.results)

    def start(self, *options):
        mine = {k: v for k, v in os.environ.items() if k != "GALLOPING_RESULTS"}
        return subprocess.Popen(
            [sys.executable, "workflow/scripts/run_study.py", *options, *SMOKE],
            cwd=self.folder,
            env=mine | {"PYTHONPATH": str(self.folder / "workflow/src")},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            # A shell that runs tests in the background lets them ignore Ctrl-C.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )

    def finish(self, *options):
        """What is said of a run that comes to its end."""
        status, said = end(self.start(*options, "--cores", "2"))
        assert status == 0, said
        return said

    def refused(self):
        """What is said of a run that does not."""
        status, said = end(self.start("--cores", "2"))
        assert status != 0, said
        return said

    def verify(self):
        status, said = self.study.keep("verify")
        assert status == 0, said

    def take(self, *names):
        for name in names:
            (self.results / name).unlink()

    def until_it_computes(self, process):
        """Wait for a job that draws; the job."""
        last = time.monotonic() + PATIENCE
        while time.monotonic() < last and process.poll() is None:
            for job in descendants(process):
                try:
                    if ".draw_" in job.cmdline()[1]:
                        return job
                except (psutil.Error, IndexError):
                    continue
            time.sleep(0.02)
        raise AssertionError(f"no job was seen: {end(process)}")

    def check(self):
        """Every byte is again what it was, and verification says so."""
        assert differing(self.sound, contents(self.results)) == []
        self.verify()


def end(process):
    said, _ = process.communicate(timeout=PATIENCE)
    return process.returncode, said


def descendants(process):
    try:
        return psutil.Process(process.pid).children(recursive=True)
    except psutil.Error:
        return []


def contents(results):
    """Digests of what a study makes, without what tells of times."""
    apart = ("logs", "benchmarks", "set_aside")
    return {
        str(path.relative_to(results)): digest(path)
        for path in results.rglob("[!.]*.*")
        if path.is_file() and path.relative_to(results).parts[0] not in apart
    }


def differing(one, other):
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


@pytest.fixture
def harmed(study, tmp_path):
    return Harmed(study, tmp_path / "study")


def test_a_killed_run_is_told_and_repaired(harmed):
    harmed.take(*FIGURES[:2])
    run = harmed.start("--cores", "1")
    job = harmed.until_it_computes(run)
    for process in descendants(run):
        if process.pid != job.pid and process.pid not in {p.pid for p in job.children()}:
            process.kill()
    run.kill()  # the job is left running
    run.wait()
    assert f"was killed: {REPAIR} takes it from there." in harmed.refused()
    harmed.finish("--repair")
    assert not psutil.pid_exists(job.pid) or psutil.Process(job.pid).status() == "zombie"
    harmed.check()


@pytest.mark.faults
def test_interruptions_second_runs_and_killed_jobs_are_told(harmed):
    harmed.take(*FIGURES)
    run = harmed.start("--cores", "1")
    harmed.until_it_computes(run)
    assert re.match(r"Process \d+ is running a study in this folder: wait", harmed.refused())
    os.killpg(run.pid, signal.SIGINT)
    status, said = end(run)
    assert status != 0
    assert said.splitlines()[-1].startswith("Interrupted. Finished jobs are kept")
    run = harmed.start("--cores", "1")
    harmed.until_it_computes(run).kill()
    status, said = end(run)
    assert status != 0
    last = said.splitlines()[-1]
    assert last.startswith("The study stopped: a job was killed (results/smoke/logs/draw_"), said
    harmed.finish()
    harmed.check()


@pytest.mark.faults
def test_damage_is_told_and_mended_and_edits_are_kept(harmed):
    assert "Nothing to do" in harmed.finish()
    harmed.take("tables/.noise_r2.csv.receipt")
    assert "tables/noise_r2.csv: no receipt says how it was made; " in harmed.refused()
    table, image = (harmed.results / name for name in ("tables/claims.csv", "figures/figure06.png"))
    state, edited = image.stat(), table.read_text() + "a line of the reader's own\n"
    table.write_text(edited)
    content = bytearray(image.read_bytes())
    content[len(content) // 2] ^= 0xFF
    with image.open("r+b") as file:
        file.write(content)
    os.utime(image, ns=(state.st_atime_ns, state.st_mtime_ns))
    receipt = harmed.results / "tables/.table2_spacers.csv.receipt"
    receipt.write_text(receipt.read_text()[:100])
    harmed.take("figures/figure05.svg")
    told = f" and 1 more: edited or damaged since its job wrote it; {REPAIR}"
    assert told in harmed.refused()
    harmed.finish("--repair")
    assert (harmed.results / "set_aside/tables/claims.csv").read_text() == edited
    harmed.check()


@pytest.mark.faults
def test_without_the_records_of_snakemake_receipts_tell_what_an_edit_made_stale(harmed):
    shutil.rmtree(harmed.folder / ".snakemake")
    smoke = harmed.folder / "config/smoke.yaml"
    smoke.write_text(smoke.read_text().replace("assessment:\n", "assessment:\n  clearance: 2\n"))
    said = harmed.refused()
    assert said.startswith("results/smoke: Snakemake's records of ")
    assert f"{REPAIR} compares the receipts instead" in said
    harmed.finish("--repair")
    changed = differing(harmed.sound, contents(harmed.results))
    depend = ("clearance", "measures", "report.html", "tables/reference_")
    assert changed and all(any(name in path for name in depend) for path in changed), changed
    harmed.verify()


@pytest.fixture
def mount():
    """Mounts something on a folder until the test ends; skips it where that is forbidden."""
    mounted = []

    def on(folder, *options):
        run = subprocess.run(["mount", *options, folder], capture_output=True, text=True)
        if run.returncode:
            pytest.skip(" ".join(run.stderr.split()))
        if "remount" not in ",".join(options):
            mounted.append(folder)

    yield on
    for folder in reversed(mounted):
        subprocess.run(["umount", folder], check=True)


@pytest.mark.faults
def test_a_full_disk_is_told(harmed, mount):
    aside = harmed.results.rename(harmed.results.with_name("aside"))
    harmed.results.mkdir()
    mount(harmed.results, "-t", "tmpfs", "-o", "size=1g", "tmpfs")
    subprocess.run(["cp", "-a", f"{aside}/.", harmed.results], check=True)
    shutil.rmtree(aside)
    harmed.take(*FIGURES)
    used = shutil.disk_usage(harmed.results).used
    mount(harmed.results, "-o", f"remount,size={used + 500_000}")
    told = "results/smoke is full: free some space and run again.\n"
    assert harmed.refused().endswith(told)
    mount(harmed.results, "-o", "remount,size=1g")
    harmed.finish()
    harmed.check()


@pytest.mark.faults
def test_a_read_only_disk_is_told(harmed, mount):
    mount(harmed.results, "--bind", str(harmed.results))
    mount(harmed.results, "-o", "remount,ro,bind")
    told = "results/smoke is read-only: make it writable and run again.\n"
    assert harmed.refused().endswith(told)
