"""Tables of noise, amount of data and claims, from the scores of all cells."""

from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.tables.claims import claims_table
from galloping.tables.data_amount import data_amount
from galloping.tables.noise import noise_coefficients, noise_r2
from galloping.tables.summary import read_scores


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    scores = read_scores(snakemake.input.scores)
    pairs = [(p, m) for p in settings["protocols"] for m in settings["methods"]]
    claims = claims_table(scores, settings["subset_level"], settings["paper_cases"], pairs)
    for path, table in (
        (output.scores, scores),
        (output.noise_coefficients, noise_coefficients(scores)),
        (output.noise_r2, noise_r2(scores)),
        (output.data_amount, data_amount(scores)),
        (output.claims, claims),
    ):
        write_rows(path, table.to_dict("records"), list(table))


run(main, snakemake)
