"""From a finished study to a folder and an archive of it that others can verify and restore."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import yaml

from galloping.publication.archive import is_plain, pack
from galloping.publication.crate import CONFIGURATION, REPORT, About, write_crate
from galloping.publication.environment import environment
from galloping.publication.manifest import write_manifest
from galloping.publication.repository import Commit, commit
from galloping.publication.run_times import run_times
from galloping.reproducibility.audit import Audit, audit
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import receipts
from galloping.storage import partial_prefix, write_json, write_rows, write_text

PUBLICATION = "publication"
RECEIPTS = "receipts.json"
SOURCES = (
    "CITATION.cff",
    "LICENSE",
    "Makefile",
    "README.md",
    "Snakefile",
    "pyproject.toml",
    "requirements.lock",
    "config",
    "workflow",
)
ALLOWABLE = ("dirty", "incomplete", "outdated")


class NotPublishable(ValueError):
    """A study that is not published as it is; one line a reason."""


def publish(plan: Plan, allowed: Collection[str] = ()) -> Path:
    """Write the publication of a study into its results folder; the path of the archive.

    allowed: obstacles (of `ALLOWABLE`) that are recorded in the archive instead of refused. The
    same study, commit and environment give the same bytes. Raises NotPublishable.
    """
    results = Path(plan.settings["results"])
    present, checked = commit(), audit(plan)
    found = list(obstacles(present, checked, results))
    if refused := [f"{kind}: {text}" for kind, text in found if kind not in allowed]:
        raise NotPublishable("\n".join(refused))
    remarks = [text for _, text in found]
    citation = yaml.safe_load(Path("CITATION.cff").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix=partial_prefix(), dir=results) as temporary:
        folder = Path(temporary, PUBLICATION)
        _copy(files(plan), folder)
        _write_records(folder, plan, present, remarks, citation)
        write_manifest(folder)
        archive = folder / f"galloping-{citation['version']}.zip"
        pack(folder, Path(temporary, archive.name))
        Path(temporary, archive.name).replace(archive)
        if (results / PUBLICATION).exists():
            (results / PUBLICATION).replace(Path(temporary, "earlier"))
        folder.replace(results / PUBLICATION)
    return results / PUBLICATION / archive.name


def obstacles(present: Commit | None, checked: Audit, results: Path) -> Iterator[tuple[str, str]]:
    """What speaks against publishing, each with its kind; `ALLOWABLE` says which can be allowed."""
    if present is None:
        yield "dirty", "git knows no commit of this folder"
    elif present.changes:
        files = _some([change[3:] for change in present.changes])
        yield "dirty", f"{files}: not as in the commit"
    if missing := [*checked.lost, *checked.absent]:
        yield "incomplete", f"{_some(missing)}: not made yet"
    if checked.unknown:
        yield "incomplete", f"{_some(checked.unknown)}: without a receipt of how it was made"
    if outdated := [*checked.outdated, *checked.inconsistent]:
        yield "outdated", f"{_some(outdated)}: made with other settings, code or inputs"
    if checked.damaged:
        yield "damaged", f"{_some(checked.damaged)}: not what its job wrote"
    if not _shown(results):
        yield "empty", f"{results}: no table or figure is made yet"
    if not (report := results / REPORT).exists():
        yield "incomplete", f"{report}: not made yet"
    elif any(shown.stat().st_mtime > report.stat().st_mtime for shown in _shown(results)):
        yield "outdated", f"{report}: older than a table or figure"


def files(plan: Plan) -> list[Path]:
    """What goes into a publication of what the working folder holds.

    The workflow; tables, figures and report; and what these are directly made from, as far as it
    lies in the working folder, so that they can be made again without computing anything else.
    """
    results = plan.settings["results"]
    maker = {path: job for job in plan.jobs for path in job.outputs}
    final = [p for p in maker if p.startswith((f"{results}/tables/", f"{results}/figures/"))]
    needed = {path for one in final for path in maker[one].inputs if is_plain(path)}
    wanted = [Path(path) for path in (*final, *needed, f"{results}/{REPORT}")]
    sources = [path for name in SOURCES for path in _sources(Path(name))]
    return sorted({path for path in (*wanted, *sources) if path.exists()})


def _sources(path: Path) -> list[Path]:
    """A file, or those below a folder without what is hidden or compiled."""
    if not path.is_dir():
        return [path]
    return [
        inner
        for inner in path.rglob("*")
        if inner.is_file()
        and not any(part.startswith(".") or part == "__pycache__" for part in inner.parts)
    ]


def _write_records(
    folder: Path, plan: Plan, present: Commit | None, remarks: Sequence[str], citation: dict
) -> None:
    """Everything in a publication that is not a copy of a file."""
    results = plan.settings["results"]
    planned = {path for job in plan.jobs for path in job.outputs}
    made = [receipt for receipt in receipts(results) if receipt.path in planned]
    versions = environment()
    write_text(
        folder / CONFIGURATION, yaml.safe_dump(plan.settings, sort_keys=False, allow_unicode=True)
    )
    write_json(folder / "environment.json", versions)
    write_rows(folder / "run_times.csv", run_times(plan.jobs, {one.path: one for one in made}))
    write_json(folder / RECEIPTS, [asdict(receipt) for receipt in made])
    write_json(
        folder / "publication.json",
        {
            "version": citation["version"],
            "commit": asdict(present) if present else None,
            "remarks": remarks,
        },
    )
    about = About(
        citation=citation,
        commit=present,
        remarks=remarks,
        python=versions["python"],
        packages=versions["packages"],
        results=results,
        made=made,
    )
    write_crate(folder, about)


def _copy(paths: Sequence[Path], folder: Path) -> None:
    for path in paths:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, folder / path)


def _shown(results: Path) -> list[Path]:
    return [*results.glob("tables/*"), *results.glob("figures/*")]


def _some(paths: Sequence[str]) -> str:
    first, *others = paths
    return f"{first} and {len(others)} more" if others else first
