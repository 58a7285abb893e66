"""One figure; `workflow/rules/figures.smk` names the function and its data."""

from pkgutil import resolve_name

from galloping.figures.style import write_figure
from galloping.reproducibility.job import run
from galloping.study.files import read_all


def draw_figure(svg, png, function, settings, look, names, **files):
    """Draw one figure from result files of the study, and write it as SVG and PNG."""
    read = read_all(files, names) | ({"settings": settings} if settings else {})
    write_figure(svg, png, lambda: resolve_name(function)(**read), **look)


if __name__ == "__main__":
    run(draw_figure, snakemake)
