"""One batch of a trial of `galloping.configuration.trials`: a row for each fit."""

import pandas as pd

from galloping.importing import imported
from galloping.reproducibility.job import run
from galloping.study.files import tables


def main() -> None:
    settings = snakemake.params.settings
    trial = imported(settings["function"])
    of_all = (settings[key] for key in ("seed", "case", "replicates", "methods"))
    rows = trial(*of_all, **settings["options"])
    tables.write(snakemake.output.fits, pd.DataFrame(rows))


run(main, snakemake)
