"""Scores of STLSQ, FROLS and the weak form with the best possible tuning in one study cell."""

from galloping.evaluation.oracle import oracle_rows
from galloping.evaluation.score import Truth
from galloping.recording.measurement import recordings_of
from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.study.files import read_model, read_trajectories


def find_oracle(
    case, protocol, cell, model, trajectory, scores,
    columns, measurement, degree, path_length, weak_path_length, steady_window,
):  # fmt: skip
    """Write the scores of sparse regression with ideal tuning, chosen with the truth."""
    line, motions = read_model(model).model, read_trajectories(trajectory)
    # the oracle also knows of terms that the library lacks
    line = line.on_polynomials(degree)
    first = motions[0]
    truth = Truth(line, first.time, first.states, tuple(steady_window), first.status)
    replicates = recordings_of(motions, name=(case, protocol, cell), **measurement)
    rows = oracle_rows(truth, replicates, path_length, weak_path_length)
    write_rows(scores, [{**columns, **row} for row in rows])


if __name__ == "__main__":
    run(find_oracle, snakemake)
