"""The data dictionary: every column of every table is in it; of plans in test_plans."""

import csv
from pathlib import Path

from galloping.report.data_dictionary import meaning
from galloping.tables import judged_claims as claims

REFERENCE = Path(__file__).parents[3] / "results" / "reference"


def heads():
    for path in sorted(REFERENCE.rglob("*.csv")):
        with path.open(encoding="utf-8") as lines:
            yield from ((path.stem, column) for column in next(csv.reader(lines)))


def test_every_column_of_the_reference_and_of_the_claims_has_a_meaning():
    own = {"claims": claims.COLUMNS, "paper": claims.PAPER_COLUMNS}
    heads_of_claims = ((table, column) for table, names in own.items() for column in names)
    assert [each for each in {*heads(), *heads_of_claims} if not meaning(*each)] == []


def test_a_table_s_own_meaning_comes_before_the_general_one():
    assert meaning("measures", "v_m") != meaning("limit_cycles", "v_m")
    assert meaning("limit_cycles", "v_m").endswith("(m)")
    assert meaning("scores", "no_such_column") == ""
