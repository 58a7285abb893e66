"""The report of a study, one self-contained page."""

from pathlib import Path

from galloping.report.headline import headline, inferred, verdicts
from galloping.report.page import Item, Page, RecordingSection, render
from galloping.report.paper import section
from galloping.report.settings import described, made_by, versions
from galloping.reproducibility.job import run
from galloping.storage import write_text
from galloping.study.loading import load

FIRST = ("overview", "trust", "paper_region")  # the figures that may stand first
CAPTIONS_OF_FIELD = {
    "quality": "The samples, with gaps, and their spectra.",
    "fit": "The samples and the model's motion, which begins anew in each stretch.",
    "forecast": "What was held out and what comes after, forecast with a 90 % band.",
}


def main() -> None:
    settings = snakemake.params.settings
    captions = settings["captions"]
    paths = dict(snakemake.input.items())
    read = load(settings["reads"], paths)

    def items(kind: str, labels: dict[str, str]) -> dict[str, Item]:
        return {
            name: Item(name, labels.get(name, name.replace("_", " ")), text, Path(path))
            for name, text in captions[kind].items()
            if (path := paths.get(f"{kind}/{name}"))
        }

    further = (read.pop(name, None) for name in ("trust", "paper", "varied", "region"))
    trust, printed, varied, region = further
    sentences = headline(**read, **settings["headline"]) if read else []

    def recordings(name: str) -> RecordingSection:
        shown = {
            figure: Path(paths[f"recordings/{name}/{figure}.svg"]) for figure in CAPTIONS_OF_FIELD
        }
        return RecordingSection(
            name,
            Path(paths[f"recordings/{name}/summary.md"]).read_text(encoding="utf-8"),
            [Item(k, f"{name}: {k}", CAPTIONS_OF_FIELD[k], path) for k, path in shown.items()],
        )

    figures = items("figures", settings["labels"])
    first = next((figures.pop(name) for name in FIRST if name in figures), None)
    page = Page(
        title="Galloping of iced overhead lines",
        paper=section(printed, varied) if printed is not None else None,
        printed=figures.pop("printed", None),
        made=made_by(),
        headline=[
            *sentences,
            *(verdicts(trust) if trust is not None else []),
            *(inferred(region) if region is not None else []),
        ],
        first=first,
        settings=described(settings["study"]),
        introduction=settings["introduction"],
        figures=list(figures.values()),
        tables=list(items("tables", {}).values()),
        recordings=[recordings(name) for name in settings["study"]["recordings"]],
        versions=versions(),
    )
    write_text(snakemake.output.report, render(page))


run(main, snakemake)
