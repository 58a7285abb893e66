"""Further initial displacements of one case, ranked by their value for identification."""

from galloping.evaluation.bounds_of_cells import ranked_releases
from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.study.files import read_model, read_trajectories

COLUMNS = (
    "case", "initial_displacement", "level", "min_coefficient_over_bound", "weakest_term",
    "identifiable",
)  # fmt: skip
HEIGHTS = (1.0, 2.0, 3.0)  # m: initial displacements of the compared further releases


def rank_releases(case, model, trajectory, ranking, level, heights=HEIGHTS):
    """Rank initial displacements of a line for a second recording, and write the table."""
    ranked = ranked_releases(
        read_model(model).model, read_trajectories(trajectory)[0], level, heights
    )
    write_rows(ranking, [{"case": case, **row} for row in ranked], COLUMNS)  # there may be none


if __name__ == "__main__":
    run(rank_releases, snakemake)
