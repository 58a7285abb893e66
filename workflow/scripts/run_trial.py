"""One batch of a trial of `galloping.configuration.kinds`: a row for each fit."""

import pandas as pd

from galloping.importing import imported
from galloping.reproducibility.job import run
from galloping.study.files import write_table


def run_trial(fits, function, seed, case, replicates, methods, options):
    rows = imported(function)(seed, case, replicates, methods, **options)
    write_table(fits, pd.DataFrame(rows))


if __name__ == "__main__":
    run(run_trial, snakemake)
