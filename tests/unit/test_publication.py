"""Archives and what is believed of them, without Snakemake."""

import json
import os
import shutil
import struct
import subprocess
import zipfile
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import yaml

from galloping.configuration.load import load, plain
from galloping.publication import archive
from galloping.publication.archive import (
    MANIFEST,
    NotRestorable,
    changed_settings,
    faults,
    is_plain,
    pack,
    restore,
    unpack,
    write_manifest,
)
from galloping.publication.publishing import files, obstacles
from galloping.reproducibility import repair
from galloping.reproducibility.digest import Commit, commit
from galloping.reproducibility.plan import Plan, PlannedJob
from galloping.reproducibility.receipts import Receipt, digest, read_receipt, write_receipt
from galloping.reproducibility.repair import Audit
from galloping.tables.comparison import table_differences

RESULTS = "results/mine"
TABLE, MODEL, RECORDING = (f"{RESULTS}/{name}" for name in ("tables/t.csv", "m.json", "r.npz"))
REPORT = f"{RESULTS}/report.html"
CONTENT = {TABLE: "case,r2\na,1\n", MODEL: "{}\n", REPORT: "report\n"}
INPUTS = {MODEL: (), RECORDING: (MODEL,), TABLE: (RECORDING, MODEL), REPORT: (TABLE,)}
CLEAN = Commit("0" * 40, "2026-11-21T12:00:00+00:00", "v1", ())


def write(folder, content):
    for name, text in content.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def present(folder=Path()):
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """An empty working folder."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


# zip files


def zipped(tmp_path, *entries):
    """A zip of (name, content), names as they are."""
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in entries:
            entry = zipfile.ZipInfo("x")
            entry.filename = entry.orig_filename = name
            file.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return path


def refused(path, target, reason="not a sound zip file"):
    target.mkdir(parents=True)
    with pytest.raises(NotRestorable, match=reason) as error:
        unpack(path, target)
    assert "\n" not in str(error.value) and str(error.value).startswith(f"{path}: ")
    return [path for path in target.parent.rglob("*") if path != target]


def test_same_files_same_bytes_and_they_come_back(tmp_path):
    folder = write(tmp_path / "folder", CONTENT)
    pack(folder, tmp_path / "a.zip")
    shutil.rmtree(folder)
    write(folder, dict(reversed(CONTENT.items())))
    for number, name in enumerate(CONTENT):
        os.utime(folder / name, (number, number))
        (folder / name).chmod(0o700)
    pack(folder, tmp_path / "b.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    unpack(tmp_path / "a.zip", tmp_path / "back")
    assert present(tmp_path / "back") == CONTENT


@pytest.mark.parametrize(
    "name",
    ["/etc/passwd", "../a", "a/../../b", "a//b", "a/", "C:/a", "a\\b", "a/.git", "naïve", "a\0b"],
)
def test_names_that_leave_the_folder_or_hide_are_refused(tmp_path, name):
    assert not is_plain(name)
    path = zipped(tmp_path, (name, "1"), ("fine", "1"))
    assert refused(path, tmp_path / "outside/target", "not a plain path") == []


def test_too_much_is_refused_and_links_become_files(tmp_path, monkeypatch):
    path = zipped(tmp_path, ("a", "123"), ("b", "456"))
    monkeypatch.setattr(archive, "MAX_SIZE", 5)
    assert refused(path, tmp_path / "outside/target", "2 files of 6 bytes; at most .* of 5") == []
    link = zipfile.ZipInfo("link")
    link.create_system, link.external_attr = 3, 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "l.zip", "w") as file:
        file.writestr(link, "/etc")
    unpack(tmp_path / "l.zip", tmp_path / "fine")
    assert not (tmp_path / "fine/link").is_symlink()


def test_a_bomb_that_lies_about_its_size_is_stopped_at_what_it_declared(tmp_path):
    path = zipped(tmp_path, ("bomb", bytes(2**24)))
    content = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\3\4", 22), (b"PK\1\2", 24)):
        struct.pack_into("<L", content, content.index(signature) + offset, 100)
    path.write_bytes(content)
    refused(path, tmp_path / "outside/target")
    assert (tmp_path / "outside/target/bomb").stat().st_size <= 100


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_names_that_clash_and_what_is_no_zip_are_refused(tmp_path):
    for number, names in enumerate([("a", "a"), ("a", "a/b"), ("a/b", "a")]):
        path = zipped(tmp_path, *((name, "1") for name in names))
        refused(path, tmp_path / f"{number}/target")
    for number, harm in enumerate([lambda c: c[:-30], lambda c: b"", lambda c: b"no zip" * 100]):
        path = zipped(tmp_path, ("a", "1"))
        path.write_bytes(harm(path.read_bytes()))
        refused(path, tmp_path / f"harm{number}/target")


# publications


@pytest.mark.parametrize("publish", [False, True])
def test_files_of_the_field_are_published_only_where_they_may(publish):
    told = f"{RESULTS}/recordings/span/summary.md"
    write(Path(), {told: "# Summary", "config/span.csv": "t", "span.yaml": "time: t"})
    recordings = {"files": ["config/span.csv"], "mapping": "span.yaml", "publish": publish}
    job = PlannedJob("identify_recordings", {}, ("config/span.csv", "span.yaml"), (told,))
    settings = plain(load({"results": RESULTS, "recordings": {"span": recordings}}))
    chosen = {path.as_posix() for path in files(Plan(settings, (job,)))}
    assert chosen - {"config/span.csv"} == {told, "span.yaml"}
    assert ("config/span.csv" in chosen) == publish


def made_here():
    """The receipts of a table, its model and its recording, as they lie in the working folder."""
    made = {}
    for path, inputs in INPUTS.items():
        name, sha256 = Path(path).stem, digest(path) if Path(path).exists() else "0" * 64
        known = {each: made[each].sha256 for each in inputs}
        made[path] = Receipt(
            path, name, {}, f"{RESULTS}/logs/{name}.log", {"code": "abc"}, known, sha256, 1, 1.5
        )
    return made


@pytest.fixture
def told(monkeypatch):
    """The plans of which Snakemake was told to take what is there as made."""
    plans = []
    monkeypatch.setattr(repair, "record", plans.append)
    return plans


def plan(results=RESULTS):
    jobs = [
        PlannedJob(Path(path).stem, {"code": "abc"}, inputs, (path,))
        for path, inputs in INPUTS.items()
    ]
    Path(results).mkdir(parents=True, exist_ok=True)
    return Plan(plain(load({"results": results})), tuple(jobs))


@pytest.fixture
def published(tmp_path, monkeypatch):
    """A publication of a table and a model; the recording between them is left out."""
    folder = write(tmp_path / "published", CONTENT)
    with monkeypatch.context() as patched:
        patched.chdir(folder)
        (folder / "receipts.json").write_text(json.dumps([asdict(r) for r in made_here().values()]))
    settings = plain(load({"results": RESULTS}))
    (folder / "configuration.yaml").write_text(yaml.safe_dump(settings))
    write_manifest(folder)
    return folder


def archived(folder):
    (folder / MANIFEST).unlink()
    write_manifest(folder)
    pack(folder, folder.with_suffix(".zip"))
    return folder.with_suffix(".zip")


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("no digest", f"{MODEL}: not in the manifest"),
        (f"{'0' * 64}  a", "a: missing"),
        (f"{'0' * 64}  {MODEL}", f"{MODEL}: changed"),
    ],
)
def test_faults_of_a_manifest_are_named(published, line, fault):
    assert list(faults(published)) == []
    (published / MANIFEST).write_text(line + "\n")
    assert fault in list(faults(published))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"path": "/etc/passwd"}, "is not a plain path in results"),
        ({"path": f"{RESULTS}/../../a"}, "is not a plain path in results"),
        ({"path": f"{RESULTS}/.m.json.receipt"}, "is not a plain path in results"),
        ({"log": f"{RESULTS}/logs/../../a"}, "is not a plain path in results"),
        ({"settings": []}, "missing, or not a list of receipts"),
    ],
)
def test_receipts_that_reach_outside_are_refused(published, changes, fault):
    made = json.loads((published / "receipts.json").read_text())
    made[0] |= changes
    (published / "receipts.json").write_text(json.dumps(made))
    with pytest.raises(NotRestorable, match=fault):
        list(restore(archived(published), plan()))
    assert present() == {}


def test_results_that_contradict_their_records_are_named(published):
    write(published, {f"{RESULTS}/tables/new.csv": "", TABLE: "case,r2\na,2\n"})
    archived(published)  # the manifest is made again, consistently
    assert list(faults(published)) == [
        f"{RESULTS}/tables/new.csv: without a receipt of how it was made",
        f"{TABLE}: not what its receipt says",
    ]
    (published / "configuration.yaml").write_text("measurement: {replicates: many}\n")
    archived(published)
    assert next(faults(published)).startswith("configuration.yaml: measurement.replicates")


def test_numbers_and_settings_of_two_studies_are_compared(published):
    write(Path(), CONTENT)
    assert list(table_differences(published / RESULTS, RESULTS)) == []
    rows = "".join(f"{name},{{}}\n" for name in "abcdefghijkl")
    write(published, {TABLE: "case,r2\n" + rows.replace("{}", "1")})
    write(Path(), {TABLE: "case,r2\n" + rows.replace("{}", "2"), f"{RESULTS}/tables/u.csv": ""})
    lines = list(table_differences(published / RESULTS, RESULTS))
    assert lines[0] == "tables/t.csv: case=a, r2: reference 1, found 2 (allowed 0.001)"
    assert lines[-2:] == ["tables/t.csv: 2 more differences", "tables/u.csv: not in the archive"]
    one, other = plain(load({})), plain(load({"results": "results/other"}))
    assert list(changed_settings(one, other)) == []
    other["measurement"]["replicates"] = 7
    assert list(changed_settings(one, other)) == [
        f"measurement.replicates: {one['measurement']['replicates']} in the archive, 7 here"
    ]


def test_what_speaks_against_publishing():
    write(Path(), CONTENT)

    def said(present=CLEAN, **states):
        return list(obstacles(present, Audit(**states), Path(RESULTS)))

    assert said() == said(elsewhere=(RECORDING,)) == []
    assert said(None) == [("dirty", "git knows no commit of this folder")]
    changed = replace(CLEAN, changes=("README.md", "a.py"))
    assert said(changed) == [("dirty", "README.md and 1 more: not as in the commit")]
    kinds = {"missing": "incomplete", "unknown": "incomplete"}
    for state, kind in (kinds | {"outdated": "outdated", "damaged": "damaged"}).items():
        ((found, text),) = said(**{state: (TABLE,)})
        assert found == kind and text.startswith(f"{TABLE}: ")
    Path(TABLE).unlink()
    assert ("empty", f"{RESULTS}: no table or figure is made yet") in said()


def test_tables_are_published_with_what_they_are_directly_made_from():
    source = {"workflow/a.py": "", "workflow/__pycache__/a.pyc": "", "workflow/.hidden": ""}
    write(Path(), {**CONTENT, **source, RECORDING: "", f"{RESULTS}/notes.txt": "mine"})
    found = [path.as_posix() for path in files(plan())]
    assert found == [MODEL, RECORDING, f"{RESULTS}/report.html", TABLE, "workflow/a.py"]


def test_an_installation_leaves_the_commit_clean(here, root):
    assert commit() is None
    shutil.copy(root / ".gitignore", here)
    git = ["git", "-c", "user.name=Nobody", "-c", "user.email=nobody@example.org"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"], ["tag", "v1"]):
        subprocess.run([*git, *command], check=True)
    # what `pip install` of a clone leaves in it
    write(here, {"build/lib/a.py": "", "workflow/src/galloping.egg-info/PKG-INFO": ""})
    assert (commit().described, commit().changes) == ("v1", ())
    (here / ".gitignore").write_text("build\n*.egg-info\n")
    (here / "b").touch()
    assert (commit().described, commit().changes) == ("v1-dirty", (".gitignore", "b"))


# restoring


def test_files_are_put_in_place_and_adopted(published, told):
    lines = list(restore(archived(published), plan()))
    assert {name: Path(name).read_text() for name in CONTENT} == CONTENT
    assert lines[0] == "3 files restored" and len(told) == 1
    assert [read_receipt(path).kept for path in INPUTS] == [True, False, True, True]
    assert len({Path(path).stat().st_mtime_ns for path in CONTENT}) == 1
    assert next(restore(archived(published), plan())) == "0 files restored"


def test_other_results_are_kept_unless_told(published, told):
    with pytest.raises(NotRestorable, match=f"results: '{RESULTS}' in the archive, not 'results'"):
        list(restore(archived(published), plan("results")))
    write(Path(), {TABLE: "my own\n", f"{RESULTS}/notes.txt": "mine\n"})
    before = present()
    with pytest.raises(NotRestorable, match=f"{TABLE}: not as in the archive; REPLACE=yes"):
        list(restore(archived(published), plan()))
    assert present() == before and told == []
    lines = list(restore(archived(published), plan(), replacing=True))
    assert lines[0] == f"1 other files set aside in {RESULTS}/set_aside"
    assert Path(RESULTS, "set_aside/tables/t.csv").read_text() == "my own\n"
    assert Path(TABLE).read_text() == CONTENT[TABLE]
    assert Path(RESULTS, "notes.txt").read_text() == "mine\n"


def test_a_forged_table_does_not_replace_what_was_computed_here(published, told):
    write(Path(), CONTENT)
    for made in made_here().values():
        write_receipt(made)
    before = present()
    write(published, {TABLE: "case,r2\na,2\n"})  # and receipts and manifest made to agree
    made = json.loads((published / "receipts.json").read_text())
    made[-2]["sha256"] = digest(published / TABLE)
    (published / "receipts.json").write_text(json.dumps(made))
    forged = archived(published)
    assert list(faults(published)) == []
    with pytest.raises(NotRestorable, match=r"r2: reference 2, found 1 .*\n.*has other numbers"):
        list(restore(forged, plan(), replacing=True))
    assert present() == before and told == []
