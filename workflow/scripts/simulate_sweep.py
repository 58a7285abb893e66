"""Long simulations of one line at some values of a sweep."""

import pandas as pd

from galloping.cycles.line_family import LIBRARY
from galloping.cycles.rows import map_rows, simulation_rows
from galloping.physics.equations import STATES
from galloping.reproducibility.job import run
from galloping.simulation import Simulator
from galloping.study.files import tables


def main() -> None:
    settings, name = snakemake.params.settings, snakemake.wildcards.case
    line, parameter, values = (settings[key] for key in ("case", "parameter", "values"))
    simulator = Simulator(STATES, LIBRARY)
    if second := settings["second"]:
        up = (second, [settings["second_value"]])
        rows = map_rows(name, line, (parameter, values), up, simulator)
    else:
        rows = simulation_rows(name, line, parameter, values, simulator)
    tables.write(snakemake.output.block, pd.DataFrame(rows))


run(main, snakemake)
