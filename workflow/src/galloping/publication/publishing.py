"""Publication of a finished study: a folder and an archive that others can verify and restore."""

import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict
from mimetypes import MimeTypes
from pathlib import Path

import yaml
from rocrate.model.contextentity import ContextEntity
from rocrate.model.entity import Entity
from rocrate.rocrate import ROCrate

from galloping.fields import list_first
from galloping.publication.archive import (
    CONFIGURATION,
    RECEIPTS,
    is_plain,
    list_files,
    pack,
    write_manifest,
)
from galloping.report.data_dictionary import captions
from galloping.report.page import made_by
from galloping.reproducibility.digest import Commit, commit, environment
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import digest, read_receipts
from galloping.reproducibility.repair import Audit, audit
from galloping.storage import partial_prefix, write_json, write_text

METADATA = "ro-crate-metadata.json"
WORKFLOW = "workflow/Snakefile"
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": "Process Run Crate",
    "https://w3id.org/ro/wfrun/workflow/0.5": "Workflow Run Crate",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": "Workflow RO-Crate",
}
DESCRIPTIONS = {
    CONFIGURATION: "all settings of the run, defaults included",
    "environment.json": "versions of Python and of all packages, and the machine",
    "publication.json": "version, commit, and what was not as it should be at publication",
    RECEIPTS: "settings, code, inputs, seconds of work and SHA-256 of every file of the "
    "study, also of those that are not in this archive",
    "report.html": "the report: what was found, figures and tables in one page",
}
FORMATS = MimeTypes()  # types known to Python, without those of the machine
FORMATS.add_type("application/yaml", ".yaml")
FORMATS.add_type("text/markdown", ".md")


def write_crate(
    folder: Path,
    results: str,
    citation: Mapping,
    commit: Commit | None,
    remarks: Sequence[str],
    versions: Mapping,
) -> None:
    """Write the RO-Crate metadata that describe all files of a study's publication.

    results: the results folder in it. citation: the content of CITATION.cff. remarks: deviations
    from a complete, up-to-date study. versions: of Python and packages.
    """
    crate = ROCrate(version="1.1")
    root = crate.root_dataset
    text = " ".join(citation["abstract"].split())
    if remarks:
        text += f" Published although: {'; '.join(remarks)}."
    root["name"], root["description"] = citation["title"], text
    root["version"] = citation["version"]
    root["datePublished"] = commit.date if commit else str(citation["date-released"])
    root["keywords"] = ", ".join(citation["keywords"])
    licence = f"https://spdx.org/licenses/{citation['license']}"
    root["license"] = _add_entity(crate, licence, "CreativeWork", name=citation["license"])
    authors = []
    for author in citation["authors"]:  # persons or, with the key `name`, organisations
        name = author.get("name") or f"{author['given-names']} {author['family-names']}"
        identifier = author.get("orcid") or f"#{name.lower().replace(' ', '-')}"
        kind = "Organization" if "name" in author else "Person"
        authors.append(_add_entity(crate, identifier, kind, name=name))
    root["author"] = authors[0] if len(authors) == 1 else authors  # RO-Crate 1.1: no list of one
    root["conformsTo"] = [
        _add_entity(crate, uri, "CreativeWork", name=name, version=uri.rsplit("/", 1)[1])
        for uri, name in PROFILES.items()
    ]
    crate.metadata["conformsTo"] = [
        {"@id": "https://w3id.org/ro/crate/1.1"},
        {"@id": "https://w3id.org/workflowhub/workflow-ro-crate/1.0"},
    ]
    workflow = crate.add_workflow(
        folder / WORKFLOW,
        WORKFLOW,
        main=True,
        lang="snakemake",
        lang_version=versions["packages"]["snakemake"],
        properties=_file_properties(folder, WORKFLOW),
    )
    workflow["name"] = citation["title"]
    workflow["version"] = commit.described if commit else citation["version"]
    files = {
        path: crate.add_file(folder / path, path, properties=_file_properties(folder, path))
        for path in list_files(folder)
        if path not in (WORKFLOW, METADATA)
    }
    files["README.md"]["about"] = root
    shown = tuple(f"{results}/{part}" for part in ("tables/", "figures/", "report.html"))
    root["mentions"] = _add_entity(
        crate,
        "#run",
        "CreateAction",
        name="The run that made the results",
        description="All jobs of the study, by Snakemake",
        instrument=workflow,
        agent=root["author"],
        object=files[CONFIGURATION],
        result=[entity for path, entity in files.items() if path.startswith(shown)],
        actionStatus="http://schema.org/CompletedActionStatus",
    )
    write_json(folder / METADATA, crate.metadata.generate())


def _file_properties(folder: Path, path: str) -> dict[str, str]:
    """Return name, description (the caption in the report, if any), format, size and digest."""
    file = folder / path
    text = DESCRIPTIONS.get(path) or DESCRIPTIONS.get(file.name) or file.stem
    caption = folder / "workflow" / "report" / "figures" / f"{file.stem}.rst"
    if file.parent.name == "tables" and file.suffix == ".csv":
        text = captions().get(file.stem, text)
    elif file.parent.name == "figures" and caption.exists():
        text = caption.read_text(encoding="utf-8")
    return {
        "name": file.name,
        "description": " ".join(text.replace("``", "").split()),
        "encodingFormat": FORMATS.guess_type(file.name)[0] or "text/plain",
        "contentSize": str(file.stat().st_size),
        "sha256": digest(file),
    }


def _add_entity(crate: ROCrate, identifier: str, kind: str, **properties: object) -> Entity:
    entity = ContextEntity(crate, identifier, {"@type": kind})
    for name, value in properties.items():
        entity[name] = value
    return crate.add(entity)


PUBLICATION = "publication"
SOURCES = (
    "CITATION.cff", "LICENSE", "Makefile", "README.md", "Snakefile", "pyproject.toml",
    "requirements.lock", "config", "profiles", "workflow",
)  # fmt: skip
ALLOWABLE_OBSTACLES = ("dirty", "incomplete", "outdated")  # can be recorded instead of refused


class NotPublishable(ValueError):
    """Error that a study cannot be published as it is; its message lists the reasons."""


def publish(plan: Plan, allowed: Collection[str] = ()) -> Path:
    """Write the folder and archive that publish a study's results, and return the archive's path.

    The folder is in the results folder. allowed: ALLOWABLE_OBSTACLES that are recorded
    in the archive instead of refused. The same study, commit and environment give the same bytes.
    Raises NotPublishable.
    """
    results = Path(plan.results)
    present = commit(plan.settings)
    reasons = list(find_obstacles(present, audit(plan), results))
    if refused := [f"{kind}: {text}" for kind, text in reasons if kind not in allowed]:
        raise NotPublishable("\n".join(refused))
    citation = yaml.safe_load(Path("CITATION.cff").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix=partial_prefix(), dir=results) as temporary:
        folder = Path(temporary, PUBLICATION)
        for path in list_published_files(plan):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, folder / path)
        # files of the publication that are not copies
        remarks, versions = [text for _, text in reasons], environment()
        records = [
            asdict(r) for path, r in read_receipts(plan.results).items() if path in plan.maker
        ]
        text = yaml.safe_dump(plan.settings, sort_keys=False, allow_unicode=True)
        write_text(folder / CONFIGURATION, text)
        write_json(folder / "environment.json", versions)
        write_json(folder / RECEIPTS, records)
        about = {"version": citation["version"], "commit": asdict(present) if present else None}
        write_json(folder / "publication.json", about | {"remarks": remarks})
        write_crate(folder, plan.results, citation, present, remarks, versions)
        write_manifest(folder)
        archive = folder / f"galloping-{citation['version']}.zip"
        pack(folder, Path(temporary, archive.name))
        Path(temporary, archive.name).replace(archive)
        if (results / PUBLICATION).exists():
            (results / PUBLICATION).replace(Path(temporary, "earlier"))
        folder.replace(results / PUBLICATION)
    return results / PUBLICATION / archive.name


def find_obstacles(
    present: Commit | None, checked: Audit, results: Path
) -> Iterator[tuple[str, str]]:
    """Yield each reason against publishing a study: its kind, such as `outdated`, and its text."""
    results_shown = [*results.glob("tables/*"), *results.glob("figures/*")]
    if present is None:
        yield "dirty", "git knows no commit of this folder"
    for kind, paths, fault in (
        ("dirty", present.changes if present else (), "not as in the commit"),
        ("incomplete", checked.missing, "not here"),
        ("incomplete", checked.unknown, "without a receipt of how it was made"),
        ("outdated", checked.outdated, "made with other settings, code or inputs"),
        ("damaged", checked.damaged, "not what its job wrote"),
        ("empty", () if results_shown else (str(results),), "no table or figure is made yet"),
    ):
        if paths:
            yield kind, f"{list_first(paths)}: {fault}"


def note_on_report(plan: Plan) -> str:
    """Return a note if the report names another commit, which alone does not rewrite it, or ''."""
    report, now = Path(plan.results, "report.html"), made_by(commit(plan.settings))
    if not report.exists() or f"Made by {now}." in report.read_text(encoding="utf-8"):
        return ""
    return f"{report}: not made by {now}; if it is removed, `make` writes it again with that name"


def list_published_files(plan: Plan) -> list[Path]:
    """List the files of a study that its publication includes.

    They are the workflow; tables, figures and report; and the direct inputs of these, so that they
    can be made again without other computations. Files outside the working folder are not listed.
    Results of field recordings are included, the recordings only if the settings say so.
    """
    maker, results = plan.maker, plan.results
    fields = plan.settings["recordings"]
    of_fields = (f"{results}/recordings/{name}/" for name in fields)
    shown = (f"{results}/tables/", f"{results}/figures/", f"{results}/report.html", *of_fields)
    final = [path for path in maker if path.startswith(shown)]
    needed = {path for made in final for path in maker[made].inputs if is_plain(path)}
    paths = [Path(path) for path in (*final, *needed, *SOURCES)]
    for folder in filter(Path.is_dir, map(Path, SOURCES)):
        paths += [folder / p for p in list_files(folder) if is_plain(p) and "__pycache__" not in p]
    private = {
        Path(path).resolve()
        for recordings in fields.values()
        if not recordings["publish"]
        for path in recordings["files"]
    }
    return sorted({p for p in paths if p.is_file() and p.resolve() not in private})
