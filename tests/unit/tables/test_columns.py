"""The data dictionary: every column of every table is in it, and nothing else."""

import csv
from pathlib import Path

import pandas as pd

from galloping.configuration.kinds import KINDS
from galloping.report.data_dictionary import columns, meaning
from galloping.tables import judged_claims as claims

REFERENCE = Path(__file__).parents[3] / "results" / "reference"
TRIALS = f"trials: {{{', '.join(f'{kind}: {{kind: {kind}}}' for kind in KINDS)}}}"
UNITS = {"m": "m", "s": "s", "percent": "%", "m_s": "m/s", "hz": "Hz"}


def heads():
    for path in sorted(REFERENCE.rglob("*.csv")):
        with path.open(encoding="utf-8") as lines:
            yield from ((path.stem, column) for column in next(csv.reader(lines)))


def test_every_column_of_the_reference_and_of_the_claims_has_a_meaning():
    own = {"claims": claims.COLUMNS, "paper": claims.PAPER_COLUMNS}
    heads_of_claims = ((table, column) for table, names in own.items() for column in names)
    assert [each for each in {*heads(), *heads_of_claims} if not meaning(*each)] == []


def told(jobs):
    """The data dictionary of a study."""
    return columns(jobs["results/tables/columns.csv"]["settings"]["settings"]["settings"])


def test_rows_are_of_tables_there_are_once_and_with_the_unit_of_their_name(jobs_of):
    rows = told(jobs_of(TRIALS))
    assert not rows.duplicated(["table", "column"]).any()
    assert (rows["meaning"].str.len() > 3).all()
    for row in rows.to_dict("records"):
        stem = row["column"].removesuffix("_low").removesuffix("_high")
        ends = [unit for end, unit in UNITS.items() if stem.endswith(f"_{end}")]
        if ends and not stem.startswith("r2_"):
            assert row["unit"] in ends, row


def test_a_study_is_told_of_its_own_tables(jobs_of):
    own = told(jobs_of())
    assert {"scores", "reduction", "reference_summary"} <= set(own["table"])
    assert "trust" not in set(own["table"])
    assert isinstance(own, pd.DataFrame) and list(own) == ["table", "column", "unit", "meaning"]


def test_a_table_s_own_meaning_comes_before_the_general_one():
    assert meaning("measures", "v_m") != meaning("limit_cycles", "v_m")
    assert meaning("limit_cycles", "v_m").endswith("(m)")
    assert meaning("scores", "no_such_column") == ""
