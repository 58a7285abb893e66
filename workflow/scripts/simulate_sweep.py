"""Long simulations of one line at some values of a sweep; of a range that grows, the new ones."""

import csv
from pathlib import Path

from galloping.cycles.family import LIBRARY
from galloping.cycles.rows import map_rows, simulation_rows
from galloping.physics.equations import STATES
from galloping.reproducibility.job import run
from galloping.reproducibility.receipts import grows
from galloping.simulation import Simulator
from galloping.storage import write_rows


def _simulated(name: str, settings: dict, values: list[float]) -> list[dict]:
    simulator = Simulator(STATES, LIBRARY)
    line, parameter = settings["case"], settings["parameter"]
    if not settings["second"]:
        return simulation_rows(name, line, parameter, values, simulator)
    up = (settings["second"], [settings["second_value"]])
    return map_rows(name, line, (parameter, values), up, simulator)


def main() -> None:
    settings, path = snakemake.params.settings, snakemake.output.block
    values, column = settings["values"], "x" if settings["second"] else "value"
    rows = {}
    if grows(path, settings, "values"):
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = {float(row[column]): row for row in csv.DictReader(file)}
    new = [value for value in values if value not in rows]
    print(f"{len(values) - len(new)} of {len(values)} values are known")
    rows |= {row[column]: row for row in _simulated(snakemake.wildcards.case, settings, new)}
    write_rows(path, [rows[value] for value in values])


run(main, snakemake)
