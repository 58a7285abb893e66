"""What publications are made of and what is believed of them, without Snakemake."""

import json
import os
import subprocess
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import yaml

from galloping.configuration.load import load, plain
from galloping.publication import restoration
from galloping.publication.archive import pack
from galloping.publication.crate import METADATA
from galloping.publication.manifest import MANIFEST, faults, write_manifest
from galloping.publication.publishing import files, obstacles
from galloping.publication.repository import Commit, commit
from galloping.publication.restoration import NotRestorable, restore
from galloping.publication.run_times import run_times
from galloping.publication.unpacked import NotAPublication, contradictions, published_receipts
from galloping.publication.validation import CONTEXT, structure
from galloping.publication.verification import changed_settings, differences, has_tables
from galloping.reproducibility.audit import Audit
from galloping.reproducibility.plan import PlannedJob
from galloping.reproducibility.receipts import Receipt, digest, read_receipt, write_receipt

RESULTS = "results/mine"
TABLE, MODEL, RECORDING = (f"{RESULTS}/{name}" for name in ("tables/t.csv", "m.json", "r.npz"))
CONTENT = {TABLE: "case,r2\na,1\n", MODEL: "{}\n", f"{RESULTS}/report.html": "report\n"}
GRAPH = [
    {"@id": METADATA, "@type": "CreativeWork"},
    {"@id": "./", "@type": "Dataset"},
    {"@id": "configuration.yaml", "@type": ["File", "ComputationalWorkflow"]},
    {"@id": "#run", "@type": "CreateAction"},
]


def receipt(path, inputs=(), **others):
    described = Receipt(
        path=path,
        rule=Path(path).stem,
        wildcards={},
        log=f"{RESULTS}/logs/{Path(path).stem}.log",
        settings={"code": "abc"},
        inputs=dict.fromkeys(inputs, "0" * 64),
        sha256=digest(path) if Path(path).exists() else "0" * 64,
        size=1,
        seconds=1.5,
    )
    return replace(described, **others)


class FakePlan:
    """The jobs that made three files; remembers what Snakemake would be told."""

    def __init__(self):
        self.settings = plain(load({"results": RESULTS}))
        self.told = []
        self.jobs = [
            PlannedJob(
                rule=Path(path).stem,
                wildcards={},
                settings={"code": "abc"},
                inputs=inputs,
                outputs=(path,),
                log=f"{RESULTS}/logs/{Path(path).stem}.log",
                benchmark=f"{RESULTS}/benchmarks/{Path(path).stem}.tsv",
            )
            for path, inputs in ((MODEL, ()), (RECORDING, (MODEL,)), (TABLE, (RECORDING, MODEL)))
        ]

    def begin(self, jobs):
        self.told.append(("begin", [job.rule for job in jobs]))

    def record(self, jobs):
        self.told.append(("record", [job.rule for job in jobs]))


def write(folder, content):
    for name, text in content.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """An empty working folder."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def published(tmp_path, monkeypatch):
    """A publication of a table and a model; the recording between them is left out."""
    folder = tmp_path / "published"
    write(folder, CONTENT)
    with monkeypatch.context() as patched:
        patched.chdir(folder)
        model, recording = receipt(MODEL), receipt(RECORDING)
        recording = replace(recording, inputs={MODEL: model.sha256})
        made = {MODEL: model.sha256, RECORDING: recording.sha256}
        table = replace(receipt(TABLE), inputs=made)
    (folder / "receipts.json").write_text(
        json.dumps([asdict(r) for r in (model, recording, table)])
    )
    (folder / "configuration.yaml").write_text(yaml.safe_dump(FakePlan().settings))
    (folder / METADATA).write_text(json.dumps({"@context": CONTEXT, "@graph": GRAPH}))
    write_manifest(folder)
    return folder


def archived(folder):
    (folder / MANIFEST).unlink()
    write_manifest(folder)
    pack(folder, folder.with_suffix(".zip"))
    return folder.with_suffix(".zip")


def present():
    return {str(path): path.read_text() for path in Path().rglob("*") if path.is_file()}


# the manifest


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("no digest", f"{MANIFEST}: line 1 is not a digest and a path"),
        (f"{'0' * 64}  a", "a: missing"),
        (f"{'0' * 64}  {MODEL}\n{'0' * 64}  {MODEL}", f"{MANIFEST}: line 2 names {MODEL} again"),
        (f"{'0' * 64}  {MODEL}", f"{MODEL}: changed"),
        ("", f"{MODEL}: not in the manifest"),
    ],
)
def test_faults_of_a_manifest_are_named(published, line, fault):
    assert list(faults(published)) == []
    (published / MANIFEST).write_text(line + "\n")
    assert fault in list(faults(published))


def test_a_manifest_that_is_no_text_is_named(published):
    (published / MANIFEST).write_bytes(b"\xff\xfe")
    assert list(faults(published)) == [f"{MANIFEST}: not text"]


# what a publication says of itself


def rewrite_receipts(folder, **changes):
    path = folder / "receipts.json"
    made = json.loads(path.read_text())
    made[0] |= changes
    path.write_text(json.dumps(made))


@pytest.mark.parametrize(
    "changes",
    [
        {"path": "/etc/passwd"},
        {"path": f"{RESULTS}/../../a"},
        {"path": "workflow/Snakefile"},
        {"path": f"{RESULTS}/.m.json.receipt"},
        {"log": f"{RESULTS}/logs/../../a"},
        {"log": "a.log"},
    ],
)
def test_receipts_that_reach_outside_are_refused(published, changes):
    assert len(published_receipts(published)) == 3
    rewrite_receipts(published, **changes)
    with pytest.raises(NotAPublication, match=r"receipts\.json: .* is not a plain path in results"):
        published_receipts(published)
    with pytest.raises(NotRestorable, match="is not a plain path"):
        list(restore(archived(published), FakePlan()))
    assert present() == {}


@pytest.mark.parametrize("changes", [{"path": 1}, {"settings": []}, {"size": "1"}])
def test_receipts_of_another_form_are_refused(published, changes):
    rewrite_receipts(published, **changes)
    with pytest.raises(NotAPublication, match="missing, or not a list of receipts"):
        published_receipts(published)


def test_bad_settings_are_refused(published):
    (published / "configuration.yaml").write_text("measurement: {replicates: many}\n")
    with pytest.raises(NotAPublication, match=r"configuration\.yaml: measurement\.replicates"):
        published_receipts(published)
    (published / "configuration.yaml").unlink()
    with pytest.raises(NotAPublication, match=r"configuration\.yaml: No such file or directory"):
        published_receipts(published)


def test_results_without_receipt_are_named(published):
    assert list(contradictions(published)) == []
    write(published, {f"{RESULTS}/tables/new.csv": ""})
    assert list(contradictions(published)) == [
        f"{RESULTS}/tables/new.csv: without a receipt of how it was made"
    ]


@pytest.mark.parametrize(
    ("metadata", "fault"),
    [
        ("[]", "not an RO-Crate"),
        ("[" * 100_000, "not an RO-Crate"),
        ({"@graph": GRAPH}, "not an RO-Crate"),
        ({"@context": CONTEXT, "@graph": [{"@id": {}}]}, "not an RO-Crate"),
        ({"@context": "file:///etc/passwd", "@graph": GRAPH}, f"another context than {CONTEXT}"),
        ({"@context": CONTEXT, "@graph": GRAPH[:1] + GRAPH[2:]}, "does not describe ./"),
        ({"@context": CONTEXT, "@graph": GRAPH[:3]}, "no run (CreateAction)"),
        (
            {"@context": CONTEXT, "@graph": [*GRAPH, {"@id": "/etc/passwd", "@type": "File"}]},
            "'/etc/passwd' is not a plain path",
        ),
    ],
)
def test_faults_of_the_description_are_named(published, metadata, fault):
    assert list(structure(published)) == []
    text = metadata if isinstance(metadata, str) else json.dumps(metadata)
    (published / METADATA).write_text(text)
    assert f"{METADATA}: {fault}" in list(structure(published))


def test_files_that_are_described_and_missing_are_named(published):
    (published / "configuration.yaml").unlink()
    fault = f"configuration.yaml: described in {METADATA} and missing"
    assert list(structure(published)) == [fault]
    (published / METADATA).unlink()
    assert list(structure(published)) == [f"{METADATA}: missing"]


# publishing

SOUND = Audit(*[()] * 9)


def said(present=None, **states):
    return list(obstacles(present, replace(SOUND, **states), Path(RESULTS)))


def test_what_speaks_against_publishing():
    clean = Commit("0" * 40, "2026-11-21T12:00:00+00:00", "v1", ())
    write(Path(), CONTENT)
    assert said(clean) == []
    assert said(None) == [("dirty", "git knows no commit of this folder")]
    changed = replace(clean, changes=(" M README.md", "?? a.py"))
    assert said(changed) == [("dirty", "README.md and 1 more: not as in the commit")]
    for state, kind in (
        ("lost", "incomplete"),
        ("absent", "incomplete"),
        ("unknown", "incomplete"),
        ("outdated", "outdated"),
        ("inconsistent", "outdated"),
        ("damaged", "damaged"),
    ):
        ((found, text),) = said(clean, **{state: (TABLE,)})
        assert found == kind and text.startswith(f"{TABLE}: ")
    assert said(clean, elsewhere=(RECORDING,)) == []


def test_a_report_older_than_a_table_is_outdated():
    write(Path(), CONTENT)
    clean = Commit("0" * 40, "2026-11-21T12:00:00+00:00", "v1", ())
    report = Path(RESULTS, "report.html")
    later = report.stat().st_mtime + 10
    os.utime(TABLE, (later, later))
    assert said(clean) == [("outdated", f"{report}: older than a table or figure")]
    report.unlink()
    assert said(clean) == [("incomplete", f"{report}: not made yet")]
    Path(TABLE).unlink()
    assert said(clean)[0] == ("empty", f"{RESULTS}: no table or figure is made yet")


def test_tables_are_published_with_what_they_are_directly_made_from():
    source = {"workflow/a.py": "", "workflow/__pycache__/a.pyc": "", "workflow/.hidden": ""}
    write(Path(), {**CONTENT, **source, RECORDING: "", f"{RESULTS}/notes.txt": "mine"})
    found = [path.as_posix() for path in files(FakePlan())]
    assert found == [MODEL, RECORDING, f"{RESULTS}/report.html", TABLE, "workflow/a.py"]


def test_run_times_are_of_jobs_and_empty_where_nothing_was_measured():
    write(Path(), {f"{RESULTS}/benchmarks/m.tsv": "s\tmax_rss\tcpu_time\n2.5\t-\tNA\n"})
    rows = run_times(FakePlan().jobs, {MODEL: receipt(MODEL)})
    assert [row["rule"] for row in rows] == ["m", "r", "t"]
    assert list(rows[0].values()) == ["m", "", "1.5", "2.5", "", ""]
    assert list(rows[1].values()) == ["r", "", "", "", "", ""]


def test_the_state_of_the_repository(here):
    assert commit() is None
    (here / "a").write_text("1")
    git = ["git", "-c", "user.name=Nobody", "-c", "user.email=nobody@example.org"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"], ["tag", "v1"]):
        subprocess.run([*git, *command], check=True)
    found = commit()
    assert (found.described, found.changes) == ("v1", ())
    (here / "a").write_text("2")
    (here / "b").touch()
    found = commit()
    assert (found.described, found.changes) == ("v1-dirty", (" M a", "?? b"))


# verifying


def test_settings_that_differ_are_named():
    one = plain(load({}))
    other = plain(load({"results": "results/other", "reference": "published"}))
    assert list(changed_settings(one, other)) == []
    other["measurement"]["replicates"] = 7
    del other["cases"]["non_resonant"]["releases"]["wide"]
    lines = list(changed_settings(one, other))
    assert "measurement.replicates: 20 in the archive, 7 here" in lines
    assert "cases.non_resonant.releases.wide.q_w: 3.0 in the archive, nothing here" in lines


def test_numbers_of_two_studies(published):
    assert not has_tables(RESULTS)
    write(Path(), CONTENT)
    assert has_tables(RESULTS)
    assert list(differences(published, RESULTS)) == []
    write(Path(), {TABLE: "case,r2\na,2\n", f"{RESULTS}/tables/u.csv": "case\na\n"})
    assert list(differences(published, RESULTS)) == [
        "tables/t.csv: case=a, r2: reference 1, found 2 (allowed 0.001)",
        "tables/u.csv: not in the archive",
    ]
    Path(TABLE).write_text("")
    Path(RESULTS, "tables/u.csv").unlink()
    assert list(differences(published, RESULTS)) == ["tables/t.csv: No columns to parse from file"]
    Path(TABLE).unlink()
    assert list(differences(published, RESULTS)) == [f"tables/t.csv: not in {RESULTS}"]


def test_of_many_differences_the_first_are_told(published):
    rows = "".join(f"{name},{{}}\n" for name in "abcdefghijkl")
    write(published, {TABLE: "case,r2\n" + rows.replace("{}", "1")})
    write(Path(), {TABLE: "case,r2\n" + rows.replace("{}", "2")})
    lines = list(differences(published, RESULTS))
    assert len(lines) == 11 and lines[-1] == "tables/t.csv: 2 more differences"


# restoring


def test_files_are_put_in_place_and_adopted(published):
    plan = FakePlan()
    lines = list(restore(archived(published), plan))
    assert {name: Path(name).read_text() for name in CONTENT} == CONTENT
    assert plan.told == [("begin", ["m", "r", "t"]), ("record", ["m", "r", "t"])]
    assert lines[0] == "3 files restored"
    assert [read_receipt(path).kept for path in (MODEL, RECORDING, TABLE)] == [True, False, True]
    assert len({path.stat().st_mtime_ns for path in map(Path, CONTENT)}) == 1
    restored, *_ = restore(archived(published), FakePlan())
    assert restored == "0 files restored"


def test_what_depends_on_other_settings_is_set_aside(published):
    plan = FakePlan()
    plan.jobs[1] = replace(plan.jobs[1], settings={"code": "def"})
    *_, aside = restore(archived(published), plan)
    assert plan.told[1] == ("record", ["m"])
    assert aside.startswith("1 files were made otherwise")
    assert not Path(TABLE).exists() and Path(MODEL).exists()


def test_an_archive_of_other_results_is_refused(published):
    plan = FakePlan()
    plan.settings["results"] = "results"
    with pytest.raises(NotRestorable, match=f"results: '{RESULTS}' in the archive, 'results' her"):
        list(restore(archived(published), plan))
    assert present() == {}


def test_other_results_are_kept_unless_told(published):
    write(Path(), {TABLE: "my own\n", f"{RESULTS}/notes.txt": "mine\n"})
    before = present()
    plan = FakePlan()
    with pytest.raises(NotRestorable, match=f"{TABLE}: not as in the archive; REPLACE=yes"):
        list(restore(archived(published), plan))
    assert present() == before and plan.told == []
    lines = list(restore(archived(published), plan, replacing=True))
    assert lines[0] == f"1 other files set aside in {RESULTS}/set_aside"
    assert Path(RESULTS, "set_aside/tables/t.csv").read_text() == "my own\n"
    assert Path(TABLE).read_text() == CONTENT[TABLE]
    assert Path(RESULTS, "notes.txt").read_text() == "mine\n"


def test_receipts_of_files_that_were_lost_give_way(published):
    write(Path(), {TABLE: "my own\n"})
    write_receipt(receipt(TABLE, settings={"code": "old"}))
    write_receipt(receipt(RECORDING, settings={"code": "old"}))
    Path(TABLE).unlink()
    plan = FakePlan()
    list(restore(archived(published), plan))
    assert plan.told[1] == ("record", ["m", "r", "t"])
    assert read_receipt(TABLE).sha256 == digest(TABLE)


@pytest.mark.parametrize("after", [0, 1, 2])
def test_a_restoring_that_fails_leaves_what_was_there(published, monkeypatch, after):
    write(Path(), {TABLE: "my own\n"})
    monkeypatch.setattr(restoration, "write_receipt", written := restoration.write_receipt)
    mine = receipt(TABLE, settings={"code": "old"})
    written(mine)
    before, count = present(), iter(range(10))

    def fail(one):
        if one.settings == {"code": "old"}:  # when undoing
            written(one)
        elif next(count) == after:
            raise OSError(28, "No space left on device")
        else:
            written(one)

    monkeypatch.setattr(restoration, "write_receipt", fail)
    with pytest.raises(OSError, match="No space left"):
        list(restore(archived(published), FakePlan(), replacing=True))
    assert present() == before
