"""The smoke study published, verified and restored."""

import json
import os
import re
import shutil
import subprocess
from dataclasses import replace

import pytest
import yaml

from galloping.publication.archive import MANIFEST, unpack
from galloping.reproducibility.receipts import digest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

RESULTS = "results/smoke"
TABLE = f"{RESULTS}/tables/noise_r2.csv"
COMMIT = ("-c", "user.name=Nobody", "-c", "user.email=nobody@example.org")
CONTEXT = "https://w3id.org/ro/crate/1.1/context"
# What the context of RO-Crate 1.1 says otherwise than that which the rocrate library comes with.
TERMS = {
    "ComputationalWorkflow": "https://bioschemas.org/ComputationalWorkflow",
    "FormalParameter": "https://bioschemas.org/FormalParameter",
    "input": "https://bioschemas.org/ComputationalWorkflow#input",
    "output": "https://bioschemas.org/ComputationalWorkflow#output",
}


def planned(study, *config):
    """How many jobs of each rule Snakemake would run."""
    said = study.ran("-n", config=tuple(map(str, config)))
    if "Nothing to be done" in said:
        return {}
    table = said.split("Job stats:")[1].split("total")[0]
    return {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", table, re.M)}


def contents(folder):
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


@pytest.fixture(scope="module")
def clone(study, tmp_path_factory):
    """A copy of the finished study that is committed."""
    clone = study.copied(tmp_path_factory.mktemp("publication") / "clone")
    for command in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "-m", "All"]):
        subprocess.run(["git", *COMMIT, *command], cwd=clone.folder, check=True)
    return clone


@pytest.fixture(scope="module")
def archive(clone):
    """The publication of the smoke study."""
    status, said = clone.keep("publish")
    assert status == 0, said
    (found,) = (clone.results / "publication").glob("*.zip")
    kept = clone.folder.parent / found.name
    shutil.copy(found, kept)
    assert f"SHA-256 {digest(kept)}" in said[0]
    return kept


@pytest.fixture(scope="module")
def unpacked(archive):
    folder = archive.parent / "unpacked"
    unpack(archive, folder)
    return folder


def test_the_folder_is_the_archive_and_says_what_it_is(clone, unpacked):
    folder = clone.results / "publication"
    check = subprocess.run(["sha256sum", "--check", "--quiet", MANIFEST], cwd=folder)
    assert check.returncode == 0
    files = contents(unpacked)
    assert files == {k: v for k, v in contents(folder).items() if not k.endswith(".zip")}
    shown = {f"{RESULTS}/{p.parent.name}/{p.name}" for p in clone.results.glob("[tf]*s/[!.]*")}
    assert len(shown) > 30 and shown <= files.keys()
    assert {"LICENSE", "requirements.lock", "workflow/Snakefile", "Makefile"} <= files.keys()
    assert not [name for name in files if "/recordings/" in name or "/reduced/" in name]
    about = json.loads(files["publication.json"])
    assert about["remarks"] == [] and re.fullmatch("[0-9a-f]{40}", about["commit"]["digest"])
    assert yaml.safe_load(files["configuration.yaml"])["measurement"]["replicates"] == 2
    assert "snakemake" in json.loads(files["environment.json"])["packages"]


@pytest.mark.filterwarnings("ignore::DeprecationWarning:rdflib")
def test_the_crate_passes_the_required_checks_of_its_profile(unpacked, tmp_path):
    from requests import Request
    from requests_cache import CachedRequest, CachedResponse, CachedSession
    from rocrate.vocabs import RO_CRATE
    from rocrate_validator.models import Severity, ValidationSettings
    from rocrate_validator.services import validate

    with CachedSession(str(tmp_path / "cache"), backend="sqlite", expire_after=-1) as session:
        request = session.prepare_request(Request("GET", CONTEXT))
        answer = CachedResponse(
            request=CachedRequest.from_request(request),
            status_code=200,
            url=CONTEXT,
            content=json.dumps({"@context": RO_CRATE["@context"] | TERMS}).encode(),
            headers={"Content-Type": "application/ld+json"},
        )
        session.cache.save_response(answer)
    result = validate(
        ValidationSettings(
            rocrate_uri=str(unpacked),
            profile_identifier="workflow-run-crate-0.5",
            requirement_severity=Severity.REQUIRED,
            cache_path=tmp_path / "cache",
            offline=True,
        )
    )
    assert [issue.message for issue in result.get_issues()] == []
    assert len(result.executed_checks) >= 57


def test_an_archive_agrees_with_its_study_and_its_digest_is_asked_for(clone, archive):
    status, said = clone.keep("verify_archive", archive)
    assert status == 0
    assert said[0].endswith(f"every file is as in its manifest; SHA-256 {digest(archive)}")
    assert said[2] == f"{RESULTS}: agrees with the archive"
    status, said = clone.keep("verify_archive", archive, "--sha256", "0" * 64)
    assert status == 1 and said[0].endswith(f"SHA-256 {digest(archive)}, not {'0' * 64}")


def test_what_is_not_clean_and_complete_is_refused_unless_told_otherwise(clone, archive):
    os.utime(clone.results / "models" / "non_resonant.json")
    status, said = clone.keep("publish")
    again = clone.results / "publication" / archive.name
    assert again.read_bytes() == archive.read_bytes()  # same study, same bytes
    (clone.folder / TABLE).unlink()
    (clone.folder / "README.md").write_text("edited\n")
    status, said = clone.keep("publish")
    assert status == 1 and again.read_bytes() == archive.read_bytes()
    assert said[0] == "dirty: README.md: not as in the commit"
    assert said[1] == f"incomplete: {TABLE}: not here"
    assert "Commit what is dirty; `make CONFIG=config/smoke.yaml` completes" in said[2]
    status, said = clone.keep("publish", "--allow", "dirty,incomplete")
    assert status == 0, said
    crate = (again.parent / "ro-crate-metadata.json").read_text()
    assert "Published although: README.md: not as in the commit" in crate


def test_a_restored_study_has_nothing_to_do_and_edits_count_as_ever(
    fresh, archive, unpacked, tmp_path
):
    restored = replace(fresh, folder=archive.parent / "restored")
    shutil.copytree(fresh.folder, restored.folder, ignore=shutil.ignore_patterns(".snakemake"))
    status, said = restored.keep("restore", archive)
    assert status == 0, said
    published = {k: v for k, v in contents(unpacked).items() if k.startswith(f"{RESULTS}/")}
    assert {name: (restored.folder / name).read_bytes() for name in published} == published
    assert planned(restored) == {}
    edit = tmp_path / "edit.yaml"
    edit.write_text("measurement: {replicates: 3}\n")  # of files that are not in the archive
    jobs = planned(restored, edit)
    assert jobs["identify_models"] > 1 and not {"derive_model", "simulate_line"} & jobs.keys()
