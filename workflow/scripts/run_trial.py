"""One batch of a trial, one row per fit; `workflow/rules/evaluate.smk` names the function."""

from pkgutil import resolve_name

import pandas as pd

from galloping.reproducibility.job import run
from galloping.study.files import write_table


def run_trial(fits, function, seed, case, replicates, methods, options):
    """Run one batch of a trial (fits to recordings of known truth), and write a row per fit."""
    rows = resolve_name(function)(seed, case, replicates, methods, **options)
    write_table(fits, pd.DataFrame(rows))


if __name__ == "__main__":
    run(run_trial, snakemake)
