"""Many noise realisations of the paper's study by its own method, in the cells of its claims."""

from galloping.paper.draws import Amounts, paper_draws
from galloping.reproducibility.job import run
from galloping.study.files import write_table


def redraw_paper(
    case, draws, line, amounts, number, threshold, path_length, kinematics, degree, seed,
):  # fmt: skip
    """Run the reproduced paper's method on many noise realisations, and write the results."""
    drawn = paper_draws(
        line, name=(case,), amounts=Amounts(**amounts), draws=number, threshold=threshold,
        path_length=path_length, kinematics=kinematics, degree=degree, seed=seed,
    )  # fmt: skip
    write_table(draws, drawn)


if __name__ == "__main__":
    run(redraw_paper, snakemake)
