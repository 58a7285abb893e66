"""Equations of the galloping of one line."""

from galloping.line.galerkin import derive
from galloping.reproducibility.job import run
from galloping.study.files import write_model


def derive_model(line, model):
    """Derive the galloping equations of one line from its parameters, and write them."""
    write_model(model, derive(line))


if __name__ == "__main__":
    run(derive_model, snakemake)
