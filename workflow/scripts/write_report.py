"""The report of a study, one self-contained page."""

from galloping.report.headline import headline
from galloping.report.page import Item, Page, render
from galloping.report.settings import described, versions
from galloping.reproducibility.job import run
from galloping.storage import write_text
from galloping.study.loading import load

FIRST = "overview"


def main() -> None:
    settings = snakemake.params.settings
    captions = settings["captions"]
    read = load(settings["reads"], dict(snakemake.input.items()))
    figures = {
        name: Item(name, settings["labels"][name], captions["figures"][name], path)
        for name, path in read["figures"].items()
    }
    tables = [
        Item(name, name.replace("_", " "), captions["tables"][name], path)
        for name, path in read["tables"].items()
    ]
    page = Page(
        title="Galloping of iced overhead lines",
        headline=headline(
            read["claims"], read["efficiency"], read["errors"], **settings["headline"]
        ),
        first=figures.get(FIRST),
        settings=described(settings["study"]),
        introduction=settings["introduction"],
        figures=list(figures.values()),
        tables=tables,
        versions=versions(),
    )
    write_text(snakemake.output.report, render(page))


run(main, snakemake)
