"""The report of a study, one self-contained page."""

from os.path import relpath
from pathlib import Path

from galloping.report.data_dictionary import captions as captions_of_tables
from galloping.report.page import Item, made_by, render, versions
from galloping.report.printed_numbers import headline as found
from galloping.report.printed_numbers import inferred, section, verdicts
from galloping.reproducibility.job import run
from galloping.storage import write_text
from galloping.study.files import read_table

PAGES = "results/pages"  # where `make pages` writes
FIRST = ("overview", "trust", "paper_region")  # the figures that may stand first
FOUND = ("efficiency", "noise_coefficients", "limit_cycles", "bifurcations")  # in the first case
CAPTIONS_OF_FIELD = {
    "quality": "The samples, with gaps, and their spectra.",
    "fit": "The samples and the model's motion, which begins anew in each stretch.",
    "forecast": "What was held out and what comes after, forecast with a 90 % band.",
}


def _items(paths: list[str], captions: dict[str, str], labels: dict[str, str]) -> dict[str, Item]:
    by_name = {Path(path).stem: Path(path) for path in paths}
    return {
        name: Item(name, labels.get(name, name.replace("_", " ")), text, by_name[name])
        for name, text in captions.items()
    }


def _recording(name: str, paths: list[str]) -> dict:
    files = {path.name: path for path in map(Path, paths) if path.parent.name == name}
    return {
        "name": name,
        "summary": files["summary.md"].read_text(encoding="utf-8"),
        "figures": [
            Item(figure, f"{name}: {figure}", caption, files[f"{figure}.svg"])
            for figure, caption in CAPTIONS_OF_FIELD.items()
        ],
    }


def write_report(
    figures, animation, tables, recordings, region, report, labels, introduction, captions,
    headline, study,
):  # fmt: skip
    drawn = _items([*figures, *animation], captions, labels)
    told_of = captions_of_tables()
    shown = _items(tables, {name: told_of[name] for name in (Path(t).stem for t in tables)}, {})

    def told(sentences, *names: str, **options) -> list[str]:
        """Sentences about tables, where the study has these."""
        if not all(name in shown for name in names):
            return []
        return sentences(*(read_table(shown[name].path) for name in names), **options)

    paper, varied = (
        read_table(shown[name].path) if name in shown else None
        for name in ("paper", "reproduction")
    )
    known = read_table(region) if region else None
    first = next((drawn.pop(name) for name in FIRST if name in drawn), None)
    page = {
        "title": "Galloping of iced overhead lines",
        "paper": section(paper, varied, known) if paper is not None else None,
        "printed": drawn.pop("printed", None),
        "made": made_by(),
        "headline": [
            *told(found, *FOUND, **headline),
            *told(verdicts, "trust"),
            *told(inferred, "paper_region"),
        ],
        "first": first,
        "study": study,
        "introduction": introduction,
        "figures": list(drawn.values()),
        "tables": list(shown.values()),
        "recordings": [_recording(name, recordings) for name in study["recordings"]],
        "versions": versions(),
        "pages": Path(relpath(PAGES, Path(report).parent)).as_posix(),
    }
    write_text(report, render(page))


if __name__ == "__main__":
    run(write_report, snakemake)
