"""One batch of a trial, a row a fit: `workflow/rules/evaluate.smk` says by which function."""

from pkgutil import resolve_name

import pandas as pd

from galloping.reproducibility.job import run
from galloping.study.files import write_table


def run_trial(fits, function, seed, case, replicates, methods, options):
    rows = resolve_name(function)(seed, case, replicates, methods, **options)
    write_table(fits, pd.DataFrame(rows))


if __name__ == "__main__":
    run(run_trial, snakemake)
