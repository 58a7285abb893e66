"""Further releases of one case, the one that would help identification most first."""

import numpy as np

from galloping.physics.equations import EQUATIONS, STATES, model
from galloping.bounds.cell import IDENTIFIABLE, rank_releases
from galloping.polynomial import term_name
from galloping.reproducibility.job import run
from galloping.simulation import Simulator
from galloping.storage import read_json, write_rows

COLUMNS = ("case", "release", "level", "weakest_t", "weakest_term", "identifiable")


def main() -> None:
    settings = snakemake.params.settings
    line = model(read_json(snakemake.input.model)["coefficients"])
    simulator = Simulator(line.states, line.terms)
    with np.load(snakemake.input.trajectory) as file:
        time, first = file["time"], file["states"][0]
    if np.isnan(first).any():  # the line itself diverges
        write_rows(snakemake.output.ranking, [], COLUMNS)
        return
    names, options = [], []
    for state, k in (("q_v", 0), ("q_w", 1)):
        for height in settings["heights"]:
            start = first[0].copy()
            start[k] = height
            motion = simulator(line, start, time)
            if motion.status == "ok":
                names.append(f"{state}(0) = {height:g} m")
                options.append((start, motion.states))
    done = [(first[0], first)]
    ranked = rank_releases(line, tuple(EQUATIONS), time, settings["level"], done, options)
    rows = []
    for k, bound in ranked:
        weakest = int(np.argmin(bound.t))
        row, term = bound.free[weakest]
        rows.append(
            {
                "case": snakemake.wildcards.case,
                "release": names[k],
                "level": settings["level"],
                "weakest_t": float(bound.t[weakest]),
                "weakest_term": f"{EQUATIONS[row]} {term_name(line.terms[term], STATES)}",
                "identifiable": bool(bound.t[weakest] > IDENTIFIABLE),
            }
        )
    write_rows(snakemake.output.ranking, rows, COLUMNS)  # there may be none


run(main, snakemake)
