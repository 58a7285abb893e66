"""What each file of a publication is, in words and as a media type."""

from __future__ import annotations

from pathlib import Path

CAPTIONS = Path("workflow/report")

FILES = {
    "Snakefile": "what `snakemake` starts with: the workflow below",
    "workflow/Snakefile": "the study as a Snakemake workflow",
    "configuration.yaml": "all settings of the run, defaults included",
    "environment.json": "versions of Python and of all packages, and the machine",
    "publication.json": "version, commit, and what was not as it should be at publication",
    "run_times.csv": "time and memory of each job",
    "receipts.json": "settings, code, inputs and SHA-256 of every file of the study, also of "
    "those that are not in this archive",
    "requirements.lock": "the environment, pinned",
    "pyproject.toml": "the packages that the study needs, and the settings of its tools",
    "CITATION.cff": "how to cite",
    "LICENSE": "the licence",
    "README.md": "what the study is and how to run it",
    "Makefile": "the commands of the README",
    "report.html": "the report: figures, tables and run times in one page",
}
FOLDERS = {
    "config": "configuration files",
    "workflow": "rules, scripts and the Python package of the study",
    "models": "derived coefficients of the equations",
    "trajectories": "simulated motions",
    "bounds": "Cramér-Rao bounds of the coefficients",
    "identified": "identified models that figures and tables show",
    "reconstructions": "reconstructed motions that figures show",
    "reference": "published numbers that the tables are compared with",
    "scores": "errors of the identified models",
}
FORMATS = {
    ".cff": "application/yaml",
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".md": "text/markdown",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".toml": "application/toml",
    ".yaml": "application/yaml",
}


def format_of(path: Path) -> str:
    """The media type of a file by its name."""
    return FORMATS.get(path.suffix, "text/plain")


def description(folder: Path, path: Path) -> str:
    """What a file or folder of the publication in `folder` is; its caption in the report if any."""
    if path.is_dir():
        return FOLDERS.get(path.name, "further data of the study")
    for caption in (f"figure_{path.stem}", path.stem):
        text = folder / CAPTIONS / f"{caption}.rst"
        if path.parent.name in ("tables", "figures") and text.exists():
            return " ".join(text.read_text(encoding="utf-8").replace("``", "").split())
    names = (path.relative_to(folder).as_posix(), path.name)
    return next((FILES[name] for name in names if name in FILES), path.stem)
