"""Report of a study, one self-contained page."""

from pathlib import Path

from galloping.figures.style import METHOD_STYLES, method_style
from galloping.report.data_dictionary import captions as captions_of_tables
from galloping.report.equations import side_by_side
from galloping.report.page import PART_TITLES, Item, made_by, render, versions
from galloping.report.printed_numbers import section
from galloping.report.results_in_words import inferred, on_engineering, on_methods
from galloping.reproducibility.digest import commit
from galloping.reproducibility.job import run
from galloping.storage import write_text
from galloping.study.files import read_table

TABLES_OF_SENTENCES = (
    "efficiency", "peers", "noise_r2", "identifiability", "trust", "limit_cycles",
    "bifurcations", "limit_cycle_ahead", "reduction", "paper", "reproduction", "equations",
    "paper_region",
)  # fmt: skip


def _items(paths: list[str], captions: dict[str, str], labels: dict[str, str]) -> dict[str, Item]:
    by_name = {Path(path).stem: Path(path) for path in paths}
    return {
        name: Item(name, labels.get(name, name.replace("_", " ")), text, by_name[name])
        for name, text in captions.items()
    }


def _recording(name: str, paths: list[str], captions: dict[str, str]) -> dict:
    files = {path.name: path for path in map(Path, paths) if path.parent.name == name}
    return {
        "name": name,
        "summary": files["summary.md"].read_text(encoding="utf-8"),
        "figures": [
            Item(figure, f"{name}: {figure}", caption, files[f"{figure}.svg"])
            for figure, caption in captions.items()
        ],
    }


def write_report(
    figures, animation, tables, recordings, region, report, labels, parts, introduction, captions,
    captions_of_recordings, headline, study,
):  # fmt: skip
    """Write the HTML report of a study from its figures, tables and recordings."""
    figure_items = _items([*figures, *animation], captions, labels)
    texts = captions_of_tables()
    items = _items(tables, {name: texts[name] for name in (Path(t).stem for t in tables)}, {})
    data = {name: read_table(items[name].path) for name in TABLES_OF_SENTENCES if name in items}
    paper, region_rows = data.get("paper"), read_table(region) if region else None
    names = {name: method_style(name).label for name in METHOD_STYLES}
    sentences = {
        "paper": inferred(data["paper_region"]) if "paper_region" in data else [],
        "methods": on_methods(data, **headline, labels=names),
        "engineering": on_engineering(data, **headline),
    }
    by_part = {
        part: {
            "sentences": sentences[part],
            "figures": [item for name, item in figure_items.items() if parts[name] == part],
        }
        for part in PART_TITLES
    }
    equations = data.get("equations")
    page = {
        "title": "Galloping of iced overhead lines",
        "paper": None
        if paper is None
        else section(paper, data.get("reproduction"), region_rows, study),
        "equations": None if equations is None else side_by_side(equations, names),
        "made": made_by(commit(study)),
        "parts": {
            name: part if any(part.values()) or (name == "methods" and introduction) else None
            for name, part in by_part.items()
        },
        "study": study,
        "introduction": introduction,
        "tables": list(items.values()),
        "recordings": [
            _recording(name, recordings, captions_of_recordings) for name in study["recordings"]
        ],
        "versions": versions(),
    }
    write_text(report, render(page))


if __name__ == "__main__":
    run(write_report, snakemake)
