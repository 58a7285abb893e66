"""From a finished study to a folder and an archive of it that others can verify and restore."""

import shutil
import tempfile
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import yaml

from galloping.publication.archive import files_of, is_plain, pack, write_manifest
from galloping.publication.crate import CONFIGURATION, write_crate
from galloping.publication.provenance import Commit, commit, environment
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import receipts
from galloping.reproducibility.repair import Audit, audit
from galloping.storage import partial_prefix, write_json, write_text

PUBLICATION = "publication"
RECEIPTS = "receipts.json"
SOURCES = (
    "CITATION.cff", "LICENSE", "Makefile", "README.md", "Snakefile", "pyproject.toml",
    "requirements.lock", "config", "workflow",
)  # fmt: skip
ALLOWABLE = ("dirty", "incomplete", "outdated")


class NotPublishable(ValueError):
    """A study that is not published as it is; one line a reason."""


def publish(plan: Plan, allowed: Collection[str] = ()) -> Path:
    """Write the publication of a study into its results folder; the path of the archive.

    allowed: obstacles (of `ALLOWABLE`) that are recorded in the archive instead of refused. The
    same study, commit and environment give the same bytes. Raises NotPublishable.
    """
    results = Path(plan.results)
    present = commit()
    found = list(obstacles(present, audit(plan), results))
    if refused := [f"{kind}: {text}" for kind, text in found if kind not in allowed]:
        raise NotPublishable("\n".join(refused))
    citation = yaml.safe_load(Path("CITATION.cff").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix=partial_prefix(), dir=results) as temporary:
        folder = Path(temporary, PUBLICATION)
        for path in files(plan):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, folder / path)
        _write_records(folder, plan, present, [text for _, text in found], citation)
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
    shown = [*results.glob("tables/*"), *results.glob("figures/*")]
    if present is None:
        yield "dirty", "git knows no commit of this folder"
    for kind, paths, fault in (
        ("dirty", present.changes if present else (), "not as in the commit"),
        ("incomplete", checked.missing, "not here"),
        ("incomplete", checked.unknown, "without a receipt of how it was made"),
        ("outdated", checked.outdated, "made with other settings, code or inputs"),
        ("damaged", checked.damaged, "not what its job wrote"),
        ("empty", () if shown else (str(results),), "no table or figure is made yet"),
    ):
        if paths:
            more = f" and {len(paths) - 1} more" if paths[1:] else ""
            yield kind, f"{paths[0]}{more}: {fault}"


def files(plan: Plan) -> list[Path]:
    """What goes into a publication of what the working folder holds.

    The workflow; tables, figures and report; and what these are directly made from, as far as it
    lies in the working folder, so that they can be made again without computing anything else.
    What recordings from the field gave goes in, their files only where they say so.
    """
    maker, results = plan.maker, plan.results
    fields = plan.settings["recordings"]
    told = (f"{results}/recordings/{name}/" for name in fields)
    shown = (f"{results}/tables/", f"{results}/figures/", f"{results}/report.html", *told)
    final = [path for path in maker if path.startswith(shown)]
    needed = {path for made in final for path in maker[made].inputs if is_plain(path)}
    wanted = [Path(path) for path in (*final, *needed, *SOURCES)]
    for folder in filter(Path.is_dir, map(Path, SOURCES)):
        wanted += [folder / p for p in files_of(folder) if is_plain(p) and "__pycache__" not in p]
    private = {
        Path(path).resolve()
        for recordings in fields.values()
        if not recordings["publish"]
        for path in recordings["files"]
    }
    return sorted({p for p in wanted if p.is_file() and p.resolve() not in private})


def _write_records(
    folder: Path, plan: Plan, present: Commit | None, remarks: Sequence[str], citation: dict
) -> None:
    """Everything in a publication that is not a copy of a file."""
    maker, versions = plan.maker, environment()
    made = {path: known for path, known in receipts(plan.results).items() if path in maker}
    text = yaml.safe_dump(plan.settings, sort_keys=False, allow_unicode=True)
    write_text(folder / CONFIGURATION, text)
    write_json(folder / "environment.json", versions)
    write_json(folder / RECEIPTS, [asdict(receipt) for receipt in made.values()])
    told = asdict(present) if present else None
    write_json(
        folder / "publication.json",
        {"version": citation["version"], "commit": told, "remarks": remarks},
    )
    write_crate(folder, plan.results, citation, present, remarks, versions)
