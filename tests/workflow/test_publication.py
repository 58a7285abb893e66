"""The smoke study published, verified and restored. About half a minute."""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest
import yaml

from galloping.publication import manifest
from galloping.publication.archive import pack, unpack
from galloping.publication.publishing import RECEIPTS
from galloping.publication.validation import conformance
from galloping.publication.verification import differences, faults

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

RESULTS = "results/smoke"
TABLE = f"{RESULTS}/tables/noise_r2.csv"
FASTER = "cases: {internal_resonance: {wind: {speed: 13}}}\n"
LARGER = "figures: {font_size: 9}\n"
COMMIT = "user.name=Nobody", "user.email=nobody@example.org"


def script(folder, name, *options, config=()):
    """One of the project's scripts, on the smoke study in `folder`."""
    command = [sys.executable, f"workflow/scripts/{name}.py", *map(str, options)]
    return subprocess.run(
        [*command, "--configfile", "config/smoke.yaml", *map(str, config)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder / "workflow" / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def git(folder, *arguments):
    options = [part for value in COMMIT for part in ("-c", value)]
    subprocess.run(["git", *options, *arguments], cwd=folder, check=True)


def planned(study, *config):
    """How many jobs of each rule Snakemake would run."""
    run = study.snakemake("-n", config=tuple(map(str, config)))
    assert run.returncode == 0, run.stdout
    if "Nothing to be done" in run.stdout:
        return {}
    table = run.stdout.split("Job stats:")[1].split("total")[0]
    return {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", table, re.M)}


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(scope="module")
def clone(study, tmp_path_factory):
    """A copy of the finished study that is committed, with a stand-in for the report."""
    assert study.first.returncode == 0, "the smoke study failed: see test_smoke.py"
    folder = tmp_path_factory.mktemp("publication") / "clone"
    shutil.copytree(study.folder, folder)
    (folder / RESULTS / "report.html").write_text("<!DOCTYPE html><title>Report</title>\n")
    git(folder, "init", "--quiet")
    git(folder, "add", ".")
    git(folder, "commit", "--quiet", "-m", "All")
    return folder


@pytest.fixture(scope="module")
def archive(clone):
    """The publication of the smoke study."""
    run = script(clone, "publish")
    assert run.returncode == 0, run.stdout
    (found,) = (clone / RESULTS / "publication").glob("*.zip")
    kept = clone.parent / found.name
    shutil.copy(found, kept)
    return kept


@pytest.fixture(scope="module")
def unpacked(archive):
    folder = archive.parent / "unpacked"
    unpack(archive, folder)
    return folder


@pytest.fixture
def tampered(unpacked, tmp_path):
    """A copy of the unpacked publication; of files that are not written to, by link."""
    folder = tmp_path / "tampered"
    shutil.copytree(unpacked, folder, copy_function=os.link)
    return folder


def rewrite(path, old, new):
    text = path.read_text()
    assert old in text
    path.unlink()  # a link
    path.write_text(text.replace(old, new, 1))


# publishing


def test_the_folder_is_the_archive_and_says_what_it_is(clone, unpacked):
    folder = clone / RESULTS / "publication"
    check = subprocess.run(["sha256sum", "--check", "--quiet", manifest.MANIFEST], cwd=folder)
    assert check.returncode == 0
    files = contents(unpacked)
    assert files == {k: v for k, v in contents(folder).items() if not k.endswith(".zip")}
    assert {"LICENSE", "CITATION.cff", "requirements.lock", "workflow/Snakefile"} <= files.keys()
    for kind in ("tables", "figures"):
        shown = {f"{RESULTS}/{kind}/{path.name}" for path in (clone / RESULTS / kind).glob("*.*")}
        assert len(shown) > 10 and shown <= files.keys() | receipts_beside(clone / RESULTS / kind)
    assert not [name for name in files if "/recordings/" in name or "/reduced/" in name]
    assert "results/reference/smoke/claims.csv" in files
    about = json.loads(files["publication.json"])
    assert about["remarks"] == [] and re.fullmatch("[0-9a-f]{40}", about["commit"]["digest"])
    assert yaml.safe_load(files["configuration.yaml"])["measurement"]["replicates"] == 2
    environment = json.loads(files["environment.json"])
    assert {"python", "packages", "machine"} == environment.keys()
    assert "snakemake" in environment["packages"]
    times = list(csv.DictReader(files["run_times.csv"].decode().splitlines()))
    assert len(times) == len({(row["rule"], row["wildcards"]) for row in times}) > 50
    assert all(float(row[name]) >= 0 for row in times for name in row if name.endswith("seconds"))


def receipts_beside(folder):
    return {f"{RESULTS}/{folder.name}/{path.name}" for path in folder.glob(".*.receipt")}


def test_same_study_same_bytes(clone, archive):
    os.utime(clone / RESULTS / "models" / "non_resonant.json")
    run = script(clone, "publish")
    assert run.returncode == 0, run.stdout
    again = clone / RESULTS / "publication" / archive.name
    assert again.read_bytes() == archive.read_bytes()


def test_what_is_not_clean_and_complete_is_refused_unless_told_otherwise(clone, archive):
    table, readme = clone / TABLE, clone / "README.md"
    text, aside = readme.read_text(), clone.parent / "aside.csv"
    before = contents(clone / RESULTS / "publication")
    try:
        table.rename(aside)
        readme.write_text("edited\n")
        run = script(clone, "publish")
        assert run.returncode == 1
        lines = run.stdout.splitlines()
        assert lines[:2] == [
            "dirty: README.md: not as in the commit",
            f"incomplete: {TABLE}: not made yet",
        ]
        assert len(lines) == 3
        assert contents(clone / RESULTS / "publication") == before
        run = script(clone, "publish", "--allow", "dirty,incomplete")
        assert run.returncode == 0, run.stdout
        about = json.loads((clone / RESULTS / "publication/publication.json").read_text())
        assert about["remarks"] == [line.split(": ", 1)[1] for line in lines[:2]]
        crate = (clone / RESULTS / "publication/ro-crate-metadata.json").read_text()
        assert "Published although: README.md: not as in the commit" in crate
    finally:
        aside.rename(table)
        readme.write_text(text)


@pytest.mark.filterwarnings("ignore::DeprecationWarning:rdflib")
def test_the_crate_passes_the_required_checks_of_its_profile(unpacked, tampered):
    checks, failed = conformance(unpacked)
    assert checks >= 57 and failed == []
    rewrite(tampered / "ro-crate-metadata.json", '"CreateAction"', '"Thing"')
    assert any("instrument" in line for line in conformance(tampered)[1])


# verifying


def test_an_archive_agrees_with_its_study(clone, archive):
    run = script(clone, "verify_archive", archive)
    assert run.returncode == 0, run.stdout
    whole, described, numbers = run.stdout.splitlines()
    assert "every file is as in its manifest" in whole
    assert re.search(r"passes the \d+ required checks of workflow-run-crate-0\.5", described)
    assert numbers == f"{RESULTS}: agrees with the archive"


def flip(folder):
    path = folder / TABLE
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.unlink()
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("harm", "lines"),
    [
        (flip, [f"{TABLE}: changed"]),
        (
            lambda folder: (folder / TABLE).rename(folder / f"{RESULTS}/tables/other.csv"),
            [
                f"{TABLE}: missing",
                f"{RESULTS}/tables/other.csv: not in the manifest",
                f"{TABLE}: described in ro-crate-metadata.json and missing",
            ],
        ),
        (
            lambda folder: (folder / "workflow/new.py").touch(),
            ["workflow/new.py: not in the manifest"],
        ),
        (
            lambda folder: (folder / RECEIPTS).unlink(),
            [
                f"{RECEIPTS}: missing",
                f"{RECEIPTS}: described in ro-crate-metadata.json and missing",
            ],
        ),
        (lambda folder: (folder / manifest.MANIFEST).unlink(), ["manifest.sha256: missing"]),
    ],
    ids=["a byte", "a name", "one more", "one less", "the manifest"],
)
def test_tampering_is_named(tampered, harm, lines):
    harm(tampered)
    assert list(faults(tampered)) == lines


def test_tampering_with_the_manifest_too_contradicts_the_receipt(tampered):
    flip(tampered)
    (tampered / manifest.MANIFEST).unlink()
    manifest.write_manifest(tampered)
    assert list(faults(tampered)) == [f"{TABLE}: not what its receipt says"]


def test_tampering_with_everything_differs_from_a_run(clone, tampered):
    with (tampered / TABLE).open() as file:
        rows = list(csv.DictReader(file))
    assert list(differences(tampered, str(clone / RESULTS))) == []
    old, new = rows[0], rows[0] | {"r2_median": "0.5"}
    rewrite(tampered / TABLE, ",".join(old.values()), ",".join(new.values()))
    (line,) = differences(tampered, str(clone / RESULTS))
    assert line.startswith("tables/noise_r2.csv: case=internal_resonance, ")
    assert ", r2_median: reference 0.5, found " in line


def test_a_tampered_archive_is_found_and_not_restored(fresh, tampered, tmp_path):
    flip(tampered)
    pack(tampered, tmp_path / "a.zip")
    before = fresh.files()
    assert before
    for name, closing in (("verify_archive", "1 faults; not as"), ("restore", "Nothing was rest")):
        run = script(fresh.folder, name, tmp_path / "a.zip")
        assert run.returncode == 1
        first, last = run.stdout.splitlines()
        assert first == f"{TABLE}: changed" and closing in last
    assert fresh.files() == before


# restoring


def untouched(fresh, folder):
    """A copy of the repository in which nothing was run."""
    shutil.copytree(fresh.folder, folder, ignore=shutil.ignore_patterns(".snakemake"))
    return replace(fresh, folder=folder)


@pytest.fixture(scope="module")
def restored(fresh, archive):
    """A copy of the repository in which nothing was run, and the archive restored."""
    study = untouched(fresh, archive.parent / "restored")
    run = script(study.folder, "restore", archive)
    assert run.returncode == 0, run.stdout
    return study


@pytest.fixture
def edit(tmp_path):
    def write(text):
        (tmp_path / "edit.yaml").write_text(text)
        return tmp_path / "edit.yaml"

    return write


def test_a_restored_study_has_nothing_to_do(restored, unpacked):
    published = {k: v for k, v in contents(unpacked).items() if k.startswith(RESULTS)}
    assert {name: (restored.folder / name).read_bytes() for name in published} == published
    assert planned(restored) == {}


def test_a_new_style_only_draws(restored, edit):
    style = edit(LARGER)
    jobs = planned(restored, style)
    assert len(jobs) == 15 and all(rule.startswith("draw_") for rule in jobs.keys() - {"all"})
    target = f"{RESULTS}/figures/figure06.svg"
    figure = restored.folder / target
    before = figure.read_bytes()
    run = restored.snakemake(target, config=(str(style),))
    assert run.returncode == 0, run.stdout
    assert figure.read_bytes() != before
    assert not list(restored.results.glob("recordings/*/*/*.npz"))


def test_an_edit_counts_the_same_before_and_after_restoring(fresh, restored, archive, edit):
    wind = edit(FASTER)
    after = planned(restored, wind)
    assert {"derive_model": 1, "simulate_line": 1, "measure_motion": 3}.items() <= after.items()
    study = untouched(fresh, archive.parent / "edited")
    run = script(study.folder, "restore", archive, config=[wind])
    assert run.returncode == 0, run.stdout
    assert "made otherwise than configured now: set aside" in run.stdout
    assert not (study.folder / TABLE).exists()
    assert (study.results / "models/non_resonant.json").exists()
    assert planned(study, wind) == after


def test_a_setting_of_files_that_were_left_elsewhere_counts(restored, edit):
    jobs = planned(restored, edit("measurement: {replicates: 3}\n"))
    assert jobs["measure_motion"] == 5  # those with noise
    assert "simulate_line" not in jobs and "tabulate_parameters" not in jobs


def test_other_results_are_replaced_only_when_told(restored, archive):
    table = restored.folder / TABLE
    content = table.read_bytes()
    table.write_text("my own\n")
    run = script(restored.folder, "restore", archive)
    assert run.returncode == 1
    assert "not as in the archive; REPLACE=yes sets" in run.stdout.splitlines()[0]
    assert table.read_text() == "my own\n"
    run = script(restored.folder, "restore", archive, "--replace")
    assert run.returncode == 0, run.stdout
    assert table.read_bytes() == content
    assert (restored.results / "set_aside/tables/noise_r2.csv").read_text() == "my own\n"
    assert planned(restored) == {}
