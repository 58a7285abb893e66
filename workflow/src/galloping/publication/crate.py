"""The description of a publication for machines: a Workflow Run RO-Crate.

Profile: Workflow Run Crate 0.5 (https://w3id.org/ro/wfrun/workflow/0.5), on RO-Crate 1.1.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from rocrate.model.contextentity import ContextEntity
from rocrate.model.entity import Entity
from rocrate.rocrate import ROCrate

from galloping.publication.descriptions import description, format_of
from galloping.publication.repository import Commit
from galloping.reproducibility.receipts import Receipt, digest
from galloping.storage import write_json

METADATA = "ro-crate-metadata.json"
WORKFLOW = "workflow/Snakefile"
CONFIGURATION = "configuration.yaml"
REPORT = "report.html"

RO_CRATE = "1.1"
WORKFLOW_RO_CRATE = "https://w3id.org/workflowhub/workflow-ro-crate/1.0"
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": "Process Run Crate",
    "https://w3id.org/ro/wfrun/workflow/0.5": "Workflow Run Crate",
    WORKFLOW_RO_CRATE: "Workflow RO-Crate",
}
BIOSCHEMAS = "https://bioschemas.org/profiles"


@dataclass(frozen=True)
class About:
    """What a crate says beyond its files.

    citation: the content of CITATION.cff. commit: None if not known. remarks: what was not as it
    should be. python, packages: versions. results: the results folder. made: receipts of the study.
    """

    citation: Mapping
    commit: Commit | None
    remarks: Sequence[str]
    python: str
    packages: Mapping[str, str]
    results: str
    made: Sequence[Receipt]


def write_crate(folder: Path, about: About) -> None:
    """Describe all files in `folder` in a metadata file beside them."""
    crate = ROCrate(version=RO_CRATE)
    _describe_root(crate, about)
    workflow = _add_workflow(crate, folder, about)
    results = folder / about.results
    shown = {
        kind: [_add_file(crate, folder, path) for path in sorted(found)]
        for kind, found in {
            "tables": (results / "tables").glob("*"),
            "figures": (results / "figures").glob("*"),
            "report": results.glob(REPORT),
        }.items()
    }
    for path in sorted(folder.iterdir()):
        if path.is_file():
            _add_file(crate, folder, path)
    for path in sorted({*folder.iterdir(), *results.parent.iterdir(), *results.iterdir()}):
        if path.is_dir() and not results.is_relative_to(path) and path.name not in shown:
            _add_folder(crate, folder, path)
    _add_run(crate, workflow, shown, about)
    write_json(folder / METADATA, crate.metadata.generate())


def _describe_root(crate: ROCrate, about: About) -> None:
    citation, root = about.citation, crate.root_dataset
    text = " ".join(citation["abstract"].split())
    if about.remarks:
        text += f" Published although: {'; '.join(about.remarks)}."
    root["name"] = citation["title"]
    root["description"] = text
    root["version"] = citation["version"]
    root["datePublished"] = about.commit.date if about.commit else str(citation["date-released"])
    root["keywords"] = ", ".join(citation["keywords"])
    root["license"] = _add(
        crate,
        f"https://spdx.org/licenses/{citation['license']}",
        "CreativeWork",
        name=citation["license"],
    )
    root["author"] = _compact([_add_author(crate, author) for author in citation["authors"]])
    root["conformsTo"] = [
        _add(crate, uri, "CreativeWork", name=name, version=uri.rsplit("/", 1)[1])
        for uri, name in PROFILES.items()
    ]
    base = {"@id": f"https://w3id.org/ro/crate/{RO_CRATE}"}
    crate.metadata["conformsTo"] = [base, {"@id": WORKFLOW_RO_CRATE}]


def _add_author(crate: ROCrate, author: Mapping[str, str]) -> Entity:
    """A person or, with the key `name`, an organisation, as CITATION.cff has them."""
    name = author.get("name") or f"{author['given-names']} {author['family-names']}"
    identifier = author.get("orcid") or f"#{name.lower().replace(' ', '-')}"
    return _add(crate, identifier, "Organization" if "name" in author else "Person", name=name)


def _add_workflow(crate: ROCrate, folder: Path, about: About) -> Entity:
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = project["dependencies"] + project["optional-dependencies"]["study"]
    needed = sorted(canonicalize_name(Requirement(text).name) for text in wanted)
    versions = {f"pypi/{name}": about.packages[name] for name in needed}
    workflow = crate.add_workflow(
        folder / WORKFLOW,
        WORKFLOW,
        main=True,
        lang="snakemake",
        lang_version=about.packages["snakemake"],
        properties=_properties(folder, folder / WORKFLOW),
    )
    workflow["name"] = about.citation["title"]
    workflow["version"] = about.commit.described if about.commit else about.citation["version"]
    workflow["conformsTo"] = {"@id": f"{BIOSCHEMAS}/ComputationalWorkflow/1.0-RELEASE"}
    workflow["softwareRequirements"] = [
        _add(
            crate,
            f"pkg:{name}@{version}",
            "SoftwareApplication",
            name=name.rsplit("/", 1)[1],
            softwareVersion=version,
        )
        for name, version in {"generic/python": about.python, **versions}.items()
    ]
    return workflow


def _add_run(
    crate: ROCrate, workflow: Entity, shown: Mapping[str, Sequence[Entity]], about: About
) -> None:
    """The run that made the results: from the configuration to tables, figures and report."""
    configuration = crate.get(CONFIGURATION)
    run = _add(
        crate,
        "#run",
        "CreateAction",
        name="The run that made the results",
        description="All jobs of the study, by Snakemake",
        instrument=workflow,
        agent=crate.root_dataset["author"],
        object=configuration,
        result=[entity for entities in shown.values() for entity in entities],
        actionStatus="http://schema.org/CompletedActionStatus",
        **_times(about.made),
    )
    crate.root_dataset["mentions"] = run
    workflow["input"] = _add_parameter(crate, "configuration", [configuration])
    workflow["output"] = [
        _add_parameter(crate, kind, entities) for kind, entities in shown.items() if entities
    ]
    crate.get("README.md")["about"] = crate.root_dataset


def _add_parameter(crate: ROCrate, name: str, examples: Sequence[Entity]) -> Entity:
    parameter = _add(
        crate,
        f"#parameter-{name}",
        "FormalParameter",
        name=name,
        additionalType="File",
        workExample=_compact(examples),
        conformsTo={"@id": f"{BIOSCHEMAS}/FormalParameter/1.0-RELEASE"},
    )
    for example in examples:
        example["exampleOfWork"] = parameter
    return parameter


def _times(made: Iterable[Receipt]) -> dict[str, str]:
    """When the first job started and the last one ended, where that was recorded."""
    ends = [(datetime.fromisoformat(one.finished), one.seconds) for one in made if one.finished]
    if not ends:
        return {}
    start = min(end - timedelta(seconds=seconds) for end, seconds in ends)
    return {
        "startTime": start.isoformat(timespec="seconds"),
        "endTime": max(ends)[0].isoformat(timespec="seconds"),
    }


def _add_file(crate: ROCrate, folder: Path, path: Path) -> Entity:
    return crate.add_file(path, path.relative_to(folder), properties=_properties(folder, path))


def _add_folder(crate: ROCrate, folder: Path, path: Path) -> Entity:
    properties = {"name": path.name, "description": description(folder, path)}
    return crate.add_dataset(path, path.relative_to(folder), properties=properties)


def _properties(folder: Path, path: Path) -> dict[str, str]:
    return {
        "name": path.name,
        "description": description(folder, path),
        "encodingFormat": format_of(path),
        "contentSize": str(path.stat().st_size),
        "sha256": digest(path),
    }


def _compact(values: Sequence) -> object:
    """One value as itself, several as a list: RO-Crate 1.1 wants no list of one."""
    return values[0] if len(values) == 1 else list(values)


def _add(crate: ROCrate, identifier: str, kind: str, **properties: object) -> Entity:
    entity = ContextEntity(crate, identifier, {"@type": kind})
    for name, value in properties.items():
        entity[name] = value
    return crate.add(entity)
