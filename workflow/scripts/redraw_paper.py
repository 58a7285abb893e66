"""Many noise realisations of the paper's study by its own method, in the cells of its claims."""

from galloping.paper.draws import Amounts, paper_draws
from galloping.reproducibility.job import run
from galloping.study.files import write_table


def redraw_paper(case, draws, line, amounts, number, method, degree, seed):
    """Run the reproduced paper's method on many noise realisations, and write the results."""
    plan = {"draws": number, "degree": degree, "seed": seed, **method}
    drawn = paper_draws(line, name=(case,), amounts=Amounts(**amounts), **plan)
    write_table(draws, drawn)


if __name__ == "__main__":
    run(redraw_paper, snakemake)
