"""Cramér-Rao bound of one study cell, and scores of its models and of models at the bound."""

from galloping.evaluation.bounds_of_cells import cell_bounds, deviations, models_at
from galloping.evaluation.score import Truth, evaluate
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.model.polynomial import polynomial_library
from galloping.reproducibility.job import run
from galloping.results import BOUND
from galloping.storage import write_rows
from galloping.study.files import (
    read_families,
    read_model,
    read_trajectories,
    write_bounds,
    write_reconstructions,
)


def evaluate_cell(
    case, protocol, cell, model, trajectory, identified, bounds, scores, reconstructions,
    columns, measurement, degree, steady_window, is_own_model,
):  # fmt: skip
    """Write scores, Cramér-Rao bounds and simulated motions of models of a set of recordings."""
    line, motions = read_model(model).model, read_trajectories(trajectory)
    line, terms = line.on_polynomials(degree), polynomial_library(len(line.states), degree)
    cell_keys = measurement, (case, protocol, cell)
    status = next(
        (m.status for m in motions[: measurement["recordings"]] if m.status != "ok"), "ok"
    )
    motion_bounds, at_bound, failed = [], [], "" if status == "ok" else "the line itself diverges"
    if is_own_model and not failed:
        try:
            motion_bounds = cell_bounds(line, motions, *cell_keys)
            at_bound = models_at(
                line, motion_bounds, *cell_keys, lacking=line.term_names[len(terms) :]
            )
        except ValueError as error:  # a state that does not move, a motion too sensitive
            failed = str(error)
    if is_own_model and failed:
        why = Finding.of(Code.COMPUTATION_FAILED, error=failed)
        nothing = IdentifiedModel.refused(line.states, line.terms, [why])
        at_bound = [nothing] * measurement["replicates"]
    models = ({BOUND: at_bound} if at_bound else {}) | read_families(identified)
    first = motions[0]
    truth = Truth(
        line, first.time, first.states, tuple(steady_window), status, is_own_model=is_own_model
    )
    least = deviations(line, motion_bounds, len(terms))
    rows, shown = evaluate(truth, models, least)
    write_bounds(bounds, least)
    write_rows(scores, [{**columns, **row} for row in rows])
    write_reconstructions(reconstructions, shown)


if __name__ == "__main__":
    run(evaluate_cell, snakemake)
