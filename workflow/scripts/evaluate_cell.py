"""The Cramer-Rao bound of one cell, and scores of its models and of models at the bound."""

from galloping.bounds.cell import cell_bounds, deviations, models_at, no_models
from galloping.evaluation.score import Truth, evaluate
from galloping.physics.equations import EQUATIONS
from galloping.polynomial import extended, library
from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.study.files import bounds, reconstructions
from galloping.study.kinds import BOUND
from galloping.study.loading import load


def main() -> None:
    settings, output, cell = snakemake.params.settings, snakemake.output, snakemake.wildcards
    read = load(settings["reads"], dict(snakemake.input.items()))
    line, motions = read["model"].model, read["trajectory"]
    terms = library(len(line.states), settings["degree"])
    line = line.on_library(extended(terms, line))
    drawn = settings["measurement"], (cell.case, cell.protocol, cell.cell)
    status = next((m.status for m in motions[: drawn[0]["recordings"]] if m.status != "ok"), "ok")
    if settings["is_continuous"]:
        known, at_bound = [], []
    elif status == "ok":
        known = cell_bounds(line, tuple(EQUATIONS), motions, *drawn)
        at_bound = models_at(line, known, *drawn, lacking=line.term_names[len(terms) :])
    else:
        known, at_bound = [], no_models(line, drawn[0], "the line itself diverges")
    models = {BOUND: at_bound} if at_bound else {}
    for family in read["identified"].values():
        models |= family
    first = motions[0]
    truth = Truth(line, first.time, first.states, tuple(settings["steady_window"]), status,
                  is_own_model=not settings["is_continuous"])  # fmt: skip
    least = deviations(line, known, len(terms))
    rows, shown = evaluate(truth, models, least)
    bounds.write(output.bounds, least)
    write_rows(output.scores, [{**settings["columns"], **row} for row in rows])
    reconstructions.write(output.reconstructions, shown)


run(main, snakemake)
