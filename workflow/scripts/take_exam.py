"""Compare the identification of fixed recordings with that of an earlier commit.

Usage: take_exam.py [--stratum NAME ...] [--before FILE] [--configfile FILE ...] [options of
run_study.py]
--stratum: only these trials of the configuration.
--before: an `answers.csv` to compare with; by default that of the reference.
Exit code 1 if a measure of a stratum is worse by more than two standard errors.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
from run_study import main as run_study

from galloping.configuration.load import load_files
from galloping.configuration.yaml_file import ConfigurationError
from galloping.study.cells import Study, Trial
from galloping.study.files import read_table
from galloping.tables import exam


def main(*arguments: str) -> int:
    """Identify a fixed set of recordings, compare with earlier results, return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--stratum", nargs="+", default=[])
    parser.add_argument("--before")
    parser.add_argument("--configfile", nargs="+", default=["config/exam.yaml"])
    args, options = parser.parse_known_args(arguments)
    try:
        study = Study(load_files(["config/config.yaml", *args.configfile]))
        trials = select_trials(study, args.stratum)
        before = read_before(study, args.before)
    except (ConfigurationError, ValueError) as error:
        sys.exit(str(error))
    folder = f"{study.settings.results}/trials"
    parts = [f"{trial.name}/{batch.name}" for trial in trials for batch in trial.batches]
    only = ["--only", *(f"{folder}/{part}.csv" for part in parts)] if args.stratum else []
    if status := run_study(*only, *options, "--configfile", *args.configfile):
        return status
    now = exam.collect_answers({part: read_table(f"{folder}/{part}.csv") for part in parts})
    before = before[before["stratum"].isin([trial.name for trial in trials])]
    compared = exam.compare_measures(before, now)
    print(*format_table(exam.sum_up_strata(now), compared), sep="\n")
    print(*format_changes(before, now), sep="\n")
    worse = [row for row in compared.to_dict("records") if exam.is_worse(row)]
    for row in worse:
        print(f"Worse by more than two standard errors: {row['measure']} of {row['stratum']}")
    return int(bool(worse))


def select_trials(study: Study, strata: Sequence[str]) -> list[Trial]:
    """Select trials of a study by name, or all for no name; raise ValueError for another name."""
    if not study.settings.exam:
        raise ValueError("exam: false; the configuration of an exam says true")
    names = [trial.name for trial in study.trials]
    for name in strata:
        if name not in names:
            raise ValueError(f"STRATUM: {name!r} is no stratum; must be of {', '.join(names)}")
    return [trial for trial in study.trials if not strata or trial.name in strata]


def read_before(study: Study, file: str | None) -> pd.DataFrame:
    """Read earlier answers from a file or the reference; raise ValueError if the file has none."""
    path = Path(file or Path(study.settings.reference, "answers.csv"))
    if not file and not path.exists():
        return pd.DataFrame(columns=exam.COLUMNS)
    try:
        answers = read_table(path)
    except (OSError, ValueError) as error:
        raise ValueError(f"BEFORE: {path}: cannot be read: {str(error).strip()}") from None
    if missing := [column for column in exam.COLUMNS if column not in answers]:
        raise ValueError(f"BEFORE: {path}: has no column {missing[0]}; must be an answers.csv")
    return exam.restore_types(answers)


def format_table(strata: pd.DataFrame, compared: pd.DataFrame) -> Iterator[str]:
    """Yield the lines of a text table of the strata, with changes from before in brackets."""
    shifts = {
        (row["stratum"], row["method"], row["measure"]): row for row in compared.to_dict("records")
    }
    rows = [["stratum", "answers", *(name.replace("_", " ") for name in exam.MEASURES), "seconds"]]
    for row in strata.to_dict("records"):
        cells = [row["stratum"], str(row["fits"])]
        for column in exam.MEASURES:
            shift = shifts.get((row["stratum"], row["method"], column))
            cells.append(_format_cell(column, row[column], shift))
        rows.append([*cells, f"{row['seconds']:.0f}"])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
    yield "(difference from before; *: of more than two standard errors, paired by recording)"


def _format_cell(column: str, value: float, shift: dict | None) -> str:
    if pd.isna(value):
        return "-"
    form = {"coverage": ".3f", "work": ".1f"}.get(column, ".0f")
    text = f"{value:{form}}"
    if shift is None or not shift["difference"]:
        return text
    share = shift["pairs"] if column == "coverage" else 1
    return f"{text} ({shift['difference'] / share:+{form}}{'*' * shift['is_significant']})"


def format_changes(before: pd.DataFrame, now: pd.DataFrame) -> Iterator[str]:
    """Yield a line of text for each recording whose identification result changed."""
    if before.empty:
        yield "There are no answers to compare with."
        return
    changes = exam.find_changes(before, now)
    yield f"{len(changes)} of {len(now)} answers changed"
    for row in changes.itertuples():
        yield f"{row.stratum}: {row.recording}: {row.change}"


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
