"""One table; `workflow/rules/tables.smk` names the function and its data."""

from pkgutil import resolve_name

from galloping.reproducibility.job import run
from galloping.study.files import read_all, write_table


def make_table(table, function, settings, names, **files):
    """Compute one table from result files of the study, and write it as CSV."""
    read = read_all(files, names) | ({"settings": settings} if settings else {})
    write_table(table, resolve_name(function)(**read))


if __name__ == "__main__":
    run(make_table, snakemake)
