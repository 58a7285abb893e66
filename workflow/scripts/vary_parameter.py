"""Claims of the paper that hold at each value of a setting that the paper does not print."""

from galloping.paper.draws import Amounts
from galloping.reproducibility.job import run
from galloping.study.files import read_table, write_table
from galloping.tables.judged_claims import variation_rows


def vary_parameter(
    parameter, drawn, claims, case, line, values, amounts, number, method, degree, seed
):
    """Assess the reproduced paper's claims at each value of a setting that the paper omits."""
    plan = {"draws": number, "degree": degree, "seed": seed, **method}
    draws, amounts = read_table(drawn), Amounts(**amounts)
    write_table(claims, variation_rows(line, plan, amounts, parameter, values, case, draws))


if __name__ == "__main__":
    run(vary_parameter, snakemake)
