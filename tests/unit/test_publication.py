"""Archives and what is believed of them, without Snakemake."""

import json
import os
import re
import shutil
import struct
import subprocess
import zipfile
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import yaml

from galloping import deferred
from galloping.configuration.load import load, plain
from galloping.publication import archive, publishing
from galloping.publication.archive import (
    MANIFEST,
    NotRestorable,
    find_faults,
    pack,
    restore,
    unpack,
)
from galloping.publication.publishing import find_obstacles, list_published_files
from galloping.report.page import made_by
from galloping.reproducibility import repair
from galloping.reproducibility.digest import Commit, commit
from galloping.reproducibility.plan import Plan, PlannedJob
from galloping.reproducibility.receipts import Receipt, digest, read_receipt, write_receipt
from galloping.reproducibility.repair import Audit

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


def zipped(path, *entries, method=zipfile.ZIP_DEFLATED):
    """A zip of (name, content), names as they are."""
    with zipfile.ZipFile(path, "w", method) as file:
        for name, content in entries:
            entry = zipfile.ZipInfo("x")
            entry.filename = entry.orig_filename = name
            file.writestr(entry, content, method)
    return path.read_bytes()


def lying(size, *entries):
    """Files that declare other sizes than they have."""

    def made(path):
        content = bytearray(zipped(path, *entries))
        for signature, offset in ((b"PK\3\4", 22), (b"PK\1\2", 24)):
            for found in re.finditer(signature, bytes(content)):
                struct.pack_into("<L", content, found.start() + offset, size)
        return content

    return made


NAMES = "/etc/passwd", "../a", "a/../../b", "a//b", "a/", "C:/a", "a\\b", "a/.git", "naïve", "a\0b"
UNSOUND = "not a sound zip file"
REFUSED = [
    *((lambda p, n=n: zipped(p, (n, "1"), ("fine", "1")), "not a plain path", 0) for n in NAMES),
    (lying(2**32 - 2, ("a", "1"), ("b", "1")), f"2 files of {2**33 - 4} bytes", 0),
    (lambda p: zipped(p, ("a", "1"), ("a/b", "1")), UNSOUND, 1),
    (lying(100, ("bomb", bytes(2**24))), UNSOUND, 100),
    (lambda p: zipped(p, ("a", "1"))[:-30], UNSOUND, 0),
    (lambda p: b"no zip" * 100, UNSOUND, 0),
    (lambda p: zipped(p, ("a", "1" * 99), method=zipfile.ZIP_LZMA), "method 14; must be", 0),
    (lambda p: zipped(p, ("a", "1" * 99), method=zipfile.ZIP_BZIP2), "method 12; must be", 0),
    (lambda p: zipped(p, ("a" * 300, "1")), UNSOUND, 0),
    (lambda p: zipped(p, ("a/" * 3000 + "a", "1")), UNSOUND, 10**9),
]


@pytest.mark.parametrize(("content", "reason", "most"), REFUSED)
def test_an_archive_that_reaches_outside_lies_or_is_none_is_refused(
    tmp_path, content, reason, most
):
    path, target = tmp_path / "a.zip", tmp_path / "outside/target"
    path.write_bytes(content(path))
    target.mkdir(parents=True)
    with pytest.raises(NotRestorable, match=reason) as error:
        unpack(path, target)
    assert "\n" not in str(error.value) and str(error.value).startswith(f"{path}: ")
    assert list(target.parent.iterdir()) == [target]
    assert sum(each.stat().st_size for each in target.rglob("*")) <= most


def test_same_files_same_bytes_and_they_come_back(tmp_path):
    for name, content in (("a", CONTENT), ("b", dict(reversed(CONTENT.items())))):
        folder = write(tmp_path / name, content)
        for number, file in enumerate(content):
            os.utime(folder / file, (number, number))
            (folder / file).chmod(0o700 if name == "a" else 0o600)
        pack(folder, tmp_path / f"{name}.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    link = zipfile.ZipInfo("link")
    link.create_system, link.external_attr = 3, 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "a.zip", "a") as file:
        file.writestr(link, "/etc")
    unpack(tmp_path / "a.zip", tmp_path / "back")
    assert present(tmp_path / "back") == CONTENT | {"link": "/etc"}  # a file, no link
    assert not (tmp_path / "back/link").is_symlink()


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
    archive.write_manifest(folder)
    return folder


def archived(folder, **content):
    """The archive of a folder that agrees with its manifest, with further files in it."""
    write(folder, content)
    (folder / MANIFEST).unlink()
    archive.write_manifest(folder)
    pack(folder, folder.with_suffix(".zip"))
    return folder.with_suffix(".zip")


def forged(folder, number, **changes):
    """The archive, with other entries in one of its receipts."""
    made = json.loads((folder / "receipts.json").read_text())
    made[number] |= changes
    return archived(folder, **{"receipts.json": json.dumps(made)})


def listed(line):
    """The publication with another line as its manifest."""

    def harm(folder):
        (folder / MANIFEST).write_text(f"{line}\n")
        pack(folder, folder.with_suffix(".zip"))

    return harm


NOT_PLAIN = "is not a plain path in results"
HARMFUL = [
    (listed("no digest"), f"{MODEL}: not in the manifest"),
    (listed(f"{'0' * 64}  a"), "a: missing"),
    (listed(f"{'0' * 64}  {MODEL}"), f"{MODEL}: changed"),
    *((lambda f, path=path: forged(f, 0, path=path), NOT_PLAIN)
      for path in ("/etc/passwd", f"{RESULTS}/../../a", f"{RESULTS}/.m.json.receipt")),
    (lambda f: forged(f, 0, log=f"{RESULTS}/logs/../../a"), NOT_PLAIN),
    (lambda f: forged(f, 0, settings=[]), "missing, or not a list of receipts"),
    (lambda f: archived(f, **{f"{RESULTS}/new.csv": ""}), "new.csv: without a receipt of how"),
    (lambda f: archived(f, **{TABLE: "case,r2\na,2\n"}), f"{TABLE}: not what its receipt says"),
    (lambda f: archived(f, **{"configuration.yaml": "measurement: {replicates: many}"}),
     "configuration.yaml: measurement.replicates: 'many'"),
]  # fmt: skip


@pytest.mark.parametrize(("harm", "fault"), HARMFUL)
def test_an_archive_that_contradicts_itself_or_reaches_outside_is_refused(published, harm, fault):
    assert list(find_faults(published)) == []
    harm(published)
    with pytest.raises(NotRestorable, match=fault):
        list(restore(published.with_suffix(".zip"), plan()))
    assert present() == {}


def test_settings_of_two_studies_are_compared():
    one, other, more = (
        plain(load({"results": f"results/{name}", "measurement": {"replicates": number}}))
        for name, number in (("one", 5), ("other", 5), ("other", 7))
    )
    assert list(archive.describe_changed_settings(one, other)) == []
    (line,) = archive.describe_changed_settings(one, more)
    assert line == "measurement.replicates: 5 in the archive, 7 here"


def test_what_speaks_against_publishing():
    write(Path(), CONTENT)

    def said(present=CLEAN, **states):
        return list(find_obstacles(present, Audit(**states), Path(RESULTS)))

    assert said() == said(elsewhere=(RECORDING,)) == []
    assert said(None) == [("dirty", "git knows no commit of this folder")]
    changed = replace(CLEAN, changes=("README.md", "a.py"))
    assert said(changed) == [("dirty", "README.md and 1 more: not as in the commit")]
    for state in ("missing", "unknown", "outdated", "damaged"):
        ((found, text),) = said(**{state: (TABLE,)})
        assert found == {"missing": "incomplete", "unknown": "incomplete"}.get(state, state)
        assert text.startswith(f"{TABLE}: ")
    Path(TABLE).unlink()
    assert ("empty", f"{RESULTS}: no table or figure is made yet") in said()


def test_a_report_of_another_commit_is_told(monkeypatch):
    write(Path(), CONTENT)
    monkeypatch.setattr(publishing, "commit", lambda _: CLEAN)
    Path(REPORT).write_text(f"Made by {made_by(CLEAN)}. More.")
    assert publishing.note_on_report(plan()) == ""
    Path(REPORT).write_text("Made by commit 0. More.")
    assert publishing.note_on_report(plan()).startswith(f"{REPORT}: not made by commit ")


def test_a_file_that_is_only_an_input_needs_no_receipt(published):
    given = f"{RESULTS}/given.csv"  # a reference among the results, and the settings name another
    made = json.loads((published / "receipts.json").read_text())
    forged(published, 0, inputs=made[0]["inputs"] | {given: "0" * 64})
    archived(published, **{given: "case\n"})
    assert list(find_faults(published)) == []


@pytest.mark.parametrize("publish", [False, True])
def test_tables_are_published_with_what_they_are_directly_made_from(publish):
    """Files of the field only where they may be."""
    source = ("profiles/a.yaml", "workflow/a.py", "workflow/__pycache__/a.pyc", "workflow/.hidden")
    told, field = f"{RESULTS}/recordings/span/summary.md", ("config/span.csv", "span.yaml")
    made = (*CONTENT, *source, RECORDING, f"{RESULTS}/notes.txt", told, *field)
    write(Path(), dict.fromkeys(made, ""))
    recordings = {"files": ["config/span.csv"], "mapping": "span.yaml", "publish": publish}
    settings = plain(load({"results": RESULTS, "recordings": {"span": recordings}}))
    study = Plan(settings, (*plan().jobs, PlannedJob("b", {}, field, (told,))))
    wanted = {MODEL, RECORDING, REPORT, TABLE, *source[:2], told, "span.yaml"}
    wanted |= {"config/span.csv"} if publish else set()
    assert [path.as_posix() for path in list_published_files(study)] == sorted(wanted)


LIBRARY = "workflow/src/galloping/__init__.py"


def commit_all(folder):
    """Make a folder a repository, with all its files in one commit."""
    git = ["git", "-c", "user.name=Nobody", "-c", "user.email=nobody@example.org"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"], ["tag", "v1"]):
        subprocess.run([*git, *command], cwd=folder, check=True)


@pytest.fixture
def clone(here, root, monkeypatch):
    """The working folder as a clone of the project."""
    monkeypatch.setattr(deferred, "SOURCE", (here / LIBRARY).parents[1])
    write(here, {LIBRARY: ""})
    shutil.copy(root / ".gitignore", here)
    return here


def present_commit(results="results", reference="results/reference"):
    return commit({"results": results, "reference": reference})


def test_an_installation_and_results_leave_the_commit_clean(clone):
    assert present_commit() is None
    commit_all(clone)
    # what `pip install` of a clone leaves in it
    write(clone, {"build/lib/a.py": "", "workflow/src/galloping.egg-info/PKG-INFO": ""})
    assert (present_commit().described, present_commit().changes) == ("v1", ())
    write(
        clone, {".gitignore": "build\n*.egg-info\n", "b": "", "out/my ö.csv": "", "out/ref/t": ""}
    )
    assert present_commit().changes == (".gitignore", "b", "out/my ö.csv", "out/ref/t")
    now = present_commit("out", "out/ref")
    assert (now.described, now.changes) == ("v1-dirty", (".gitignore", "b", "out/ref/t"))
    assert made_by(now).endswith(" and 3 changed files")
    assert made_by(replace(now, changes=("b",))).endswith(" and 1 changed file")


def test_no_commit_is_that_of_another_repository_or_of_a_user(clone, tmp_path, monkeypatch):
    write(tmp_path, {".gitignore": "here\n"})
    commit_all(tmp_path)
    assert present_commit() is None
    commit_all(clone)
    assert present_commit().described == "v1"
    monkeypatch.chdir(tmp_path)
    own = subprocess.check_output(["git", "rev-parse", "HEAD"], text=True).strip()
    assert present_commit().digest != own


def test_a_signed_commit_is_known_where_git_shows_signatures(clone, monkeypatch):
    write(clone, {"gpg": """#!/bin/sh
cat > /dev/null
case "$*" in
*--verify*) echo "gpg: good" >&2; echo "[GNUPG:] GOODSIG 0 Nobody" ;;
*) echo "[GNUPG:] SIG_CREATED D" >&2; echo "-----BEGIN PGP SIGNATURE-----" ;;
esac
"""})  # fmt: skip
    (clone / "gpg").chmod(0o755)
    options = {
        "gpg.program": str(clone / "gpg"), "commit.gpgSign": "true", "user.signingKey": "0",
        "log.showSignature": "true",
    }  # fmt: skip
    monkeypatch.setenv("GIT_CONFIG_COUNT", str(len(options)))
    for number, (key, value) in enumerate(options.items()):
        monkeypatch.setenv(f"GIT_CONFIG_KEY_{number}", key)
        monkeypatch.setenv(f"GIT_CONFIG_VALUE_{number}", value)
    commit_all(clone)
    shown = subprocess.check_output(["git", "show", "--no-patch", "--format=%H"], text=True)
    assert "gpg: good" in shown and present_commit().described == "v1"


def test_files_are_put_in_place_and_adopted(published, told):
    assert next(restore(archived(published), plan())) == "3 files restored"
    assert {name: Path(name).read_text() for name in CONTENT} == CONTENT
    assert [read_receipt(path).kept for path in INPUTS] == [True, False, True, True]
    assert len({Path(path).stat().st_mtime_ns for path in CONTENT}) == 1
    lines = list(restore(archived(published), plan()))
    assert lines[0] == "0 files restored" and len(told) == 1


def test_other_results_are_kept_unless_told(published, told):
    with pytest.raises(NotRestorable, match=f"results: '{RESULTS}' .*'results'"):
        list(restore(archived(published), plan("results")))
    write(Path(), {TABLE: "my own\n", f"{RESULTS}/notes.txt": "mine\n"})
    before = present()
    with pytest.raises(NotRestorable, match=f"{TABLE}: .*REPLACE=yes"):
        list(restore(archived(published), plan()))
    assert present() == before and told == []
    lines = list(restore(archived(published), plan(), replacing=True))
    assert lines[0] == f"1 other files set aside in {RESULTS}/set_aside"
    assert Path(RESULTS, "set_aside/tables/t.csv").read_text() == "my own\n"
    assert Path(TABLE).read_text() == CONTENT[TABLE]
    assert Path(RESULTS, "notes.txt").read_text() == "mine\n"


def test_a_digest_may_be_pasted_with_blanks_and_capitals(here):
    (here / "a.zip").write_text("any")
    right = digest("a.zip")
    assert archive.check_digest("a.zip", f"{right.upper()} ") == right
    with pytest.raises(NotRestorable, match=f"^a.zip: SHA-256 {right}, not 12$"):
        archive.check_digest("a.zip", "12")


def test_a_forged_table_does_not_replace_what_was_computed_here(published, told):
    write(Path(), CONTENT)
    for made in made_here().values():
        write_receipt(made)
    before = present()
    write(published, {TABLE: "case,r2\na,2\n"})  # and receipts and manifest made to agree
    wrong = forged(published, -2, sha256=digest(published / TABLE))
    with pytest.raises(NotRestorable, match="r2: reference 2, found 1 "):
        list(restore(wrong, plan(), replacing=True))
    assert present() == before and told == []
