"""One figure of `galloping.figures.registry`."""

from galloping.figures.style import write_figure
from galloping.importing import imported
from galloping.reproducibility.job import run
from galloping.study.loading import load


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    read = load(settings["reads"], dict(snakemake.input.items()))
    draw = imported(settings["function"])
    write_figure(
        output.svg,
        output.png,
        lambda: draw(**read, settings=settings["shown"]),
        **settings["look"],
    )


run(main, snakemake)
