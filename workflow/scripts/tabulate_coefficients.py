"""Table 3: true and identified coefficients without noise."""

import pandas as pd

from galloping.identification.model import read
from galloping.physics.equations import STATES
from galloping.polynomial import library
from galloping.reproducibility.job import run
from galloping.storage import read_json, write_rows
from galloping.tables.coefficients import identified_terms, table3


def main() -> None:
    settings = snakemake.params.settings
    terms = library(len(STATES), settings["degree"])
    names = {key: settings[key] for key in ("protocol", "method", "level")}
    tables = [
        identified_terms(read_json(model)["coefficients"], read(identified), terms).assign(
            case=case, **names
        )
        for case, model, identified in zip(
            settings["cases"], snakemake.input.models, snakemake.input.identified, strict=True
        )
    ]
    write_rows(snakemake.output.table, table3(pd.concat(tables)).to_dict("records"))


run(main, snakemake)
