"""Limit cycles of one line along a parameter, and where they begin, change and end."""

from galloping.cycles.family import LIBRARY
from galloping.cycles.rows import bifurcation_rows, limit_cycle_rows, line_diagram
from galloping.physics.equations import STATES
from galloping.reproducibility.job import run
from galloping.simulation import Simulator
from galloping.storage import write_rows

COLUMNS = [  # of a line that never gallops, too
    "case", "parameter", "unit", "value", "branch", "point", "stable", "v_m", "w_m", "period_s",
    "largest_multiplier", "trivial_defect",
]  # fmt: skip


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    case, name = snakemake.wildcards.case, settings["parameter"]
    simulator = Simulator(STATES, LIBRARY)
    along = line_diagram(settings["case"], name, *settings["range"], simulator)
    write_rows(output.cycles, limit_cycle_rows(case, name, along), COLUMNS)
    write_rows(output.bifurcations, bifurcation_rows(case, name, along, settings["case"]))


run(main, snakemake)
