"""The description of a publication for machines: a Workflow Run RO-Crate.

Profile: Workflow Run Crate 0.5 (https://w3id.org/ro/wfrun/workflow/0.5), on RO-Crate 1.1.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rocrate.model.contextentity import ContextEntity
from rocrate.model.entity import Entity
from rocrate.rocrate import ROCrate

from galloping.publication.archive import files_of
from galloping.publication.provenance import Commit
from galloping.reproducibility.receipts import digest
from galloping.storage import write_json

METADATA = "ro-crate-metadata.json"
WORKFLOW = "workflow/Snakefile"
CONFIGURATION = "configuration.yaml"
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": "Process Run Crate",
    "https://w3id.org/ro/wfrun/workflow/0.5": "Workflow Run Crate",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": "Workflow RO-Crate",
}
DESCRIPTIONS = {
    CONFIGURATION: "all settings of the run, defaults included",
    "environment.json": "versions of Python and of all packages, and the machine",
    "publication.json": "version, commit, and what was not as it should be at publication",
    "receipts.json": "settings, code, inputs, seconds of work and SHA-256 of every file of the "
    "study, also of those that are not in this archive",
    "report.html": "the report: what was found, figures and tables in one page",
}
FORMATS = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".md": "text/markdown",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".yaml": "application/yaml",
}


def write_crate(
    folder: Path,
    results: str,
    citation: Mapping,
    commit: Commit | None,
    remarks: Sequence[str],
    versions: Mapping,
) -> None:
    """Describe all files in `folder` in a metadata file beside them.

    results: the results folder in it. citation: the content of CITATION.cff. remarks: what was not
    as it should be. versions: of Python and packages.
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
    root["license"] = _add(crate, licence, "CreativeWork", name=citation["license"])
    authors = [_add_author(crate, author) for author in citation["authors"]]
    root["author"] = authors[0] if len(authors) == 1 else authors  # 1.1 wants no list of one
    root["conformsTo"] = [
        _add(crate, uri, "CreativeWork", name=name, version=uri.rsplit("/", 1)[1])
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
        properties=_properties(folder, WORKFLOW),
    )
    workflow["name"] = citation["title"]
    workflow["version"] = commit.described if commit else citation["version"]
    files = {
        path: crate.add_file(folder / path, path, properties=_properties(folder, path))
        for path in files_of(folder)
        if path not in (WORKFLOW, METADATA)
    }
    files["README.md"]["about"] = root
    shown = tuple(f"{results}/{part}" for part in ("tables/", "figures/", "report.html"))
    root["mentions"] = _add(
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


def _add_author(crate: ROCrate, author: Mapping[str, str]) -> Entity:
    """A person or, with the key `name`, an organisation, as CITATION.cff has them."""
    name = author.get("name") or f"{author['given-names']} {author['family-names']}"
    identifier = author.get("orcid") or f"#{name.lower().replace(' ', '-')}"
    return _add(crate, identifier, "Organization" if "name" in author else "Person", name=name)


def _properties(folder: Path, path: str) -> dict[str, str]:
    """Name, description (the caption in the report, if it has one), format, size and digest."""
    file = folder / path
    text = DESCRIPTIONS.get(path) or DESCRIPTIONS.get(file.name) or file.stem
    caption = folder / "workflow" / "report" / file.parent.name / f"{file.stem}.rst"
    if caption.exists():
        text = " ".join(caption.read_text(encoding="utf-8").replace("``", "").split())
    return {
        "name": file.name,
        "description": text,
        "encodingFormat": FORMATS.get(file.suffix, "text/plain"),
        "contentSize": str(file.stat().st_size),
        "sha256": digest(file),
    }


def _add(crate: ROCrate, identifier: str, kind: str, **properties: object) -> Entity:
    entity = ContextEntity(crate, identifier, {"@type": kind})
    for name, value in properties.items():
        entity[name] = value
    return crate.add(entity)
