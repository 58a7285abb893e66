"""Limit cycles of one line along a parameter, and their bifurcations."""

from galloping.cycles.family import LIBRARY
from galloping.cycles.rows import bifurcation_rows, limit_cycle_rows, line_diagram
from galloping.line.galerkin import STATES
from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.trajectory.simulation import Simulator

COLUMNS = [  # also those of a line that never gallops
    "case", "parameter", "unit", "value", "branch", "point", "stable", "vertical_amplitude_m",
    "horizontal_amplitude_m", "period_s", "largest_multiplier", "trivial_multiplier_error",
]  # fmt: skip


def follow_cycles(case, cycles, bifurcations, line, parameter, ends):
    """Write tables of a line's limit cycles and bifurcations along a parameter."""
    along = line_diagram(line, parameter, *ends, Simulator(STATES, LIBRARY))
    write_rows(cycles, limit_cycle_rows(case, parameter, along), COLUMNS)
    write_rows(bifurcations, bifurcation_rows(case, parameter, along, line))


if __name__ == "__main__":
    run(follow_cycles, snakemake)
