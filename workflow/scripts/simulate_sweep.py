"""Long simulations of one line at values of a parameter; only new values if the range grows."""

import csv
from functools import partial
from pathlib import Path

from galloping.cycles.family import LIBRARY
from galloping.cycles.rows import map_rows, simulation_rows
from galloping.line.galerkin import STATES
from galloping.reproducibility.job import run
from galloping.reproducibility.receipts import differs_only_in
from galloping.storage import write_rows
from galloping.trajectory.simulation import Simulator


def simulate_sweep(case, simulated, line, parameter, values, second, second_value, is_grown=False):
    """Simulate a line to its final motion at each value of a parameter; write a row for each.

    is_grown: whether the file exists, made with the same settings but fewer values.
    """
    column, rows = "x" if second else "value", {}
    if is_grown:
        with Path(simulated).open(encoding="utf-8", newline="") as file:
            rows = {float(row[column]): row for row in csv.DictReader(file)}
    new = [value for value in values if value not in rows]
    print(f"{len(values) - len(new)} of {len(values)} values are known")
    simulator = Simulator(STATES, LIBRARY)
    if second:
        up = (second, [second_value])
        new_rows = map_rows(case, line, (parameter, new), up, simulator)
    else:
        new_rows = simulation_rows(case, line, parameter, new, simulator)
    rows |= {row[column]: row for row in new_rows}
    write_rows(simulated, [rows[value] for value in values])


if __name__ == "__main__":
    is_grown = differs_only_in(snakemake.output.simulated, dict(snakemake.params.items()), "values")
    run(partial(simulate_sweep, is_grown=is_grown), snakemake)
