"""The times of a recording, where they are written as dates or as times of a day."""

import numpy as np
import pandas as pd

from galloping.field.file_table import FileTable
from galloping.field.mapping import TimeColumn

DAYS = (
    "%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%m/%d/%y",
    "%d/%m/%y", "%d-%b-%Y",
)  # fmt: skip
HOURS = [f"%{hours}.%f{half}" for hours, half in (("H:%M:%S", ""), ("I:%M:%S", " %p"))]
HOURS += [hours.replace(".%f", ":%f") for hours in HOURS]
WHOLE = r"(?<![:\d])(\d\d?:\d\d:\d\d)(?![.:\d])"  # seconds, which may stand among fractions of them
FORMS = [f"{day} {hour}" for day in DAYS for hour in HOURS] + HOURS


def instants(table: FileTable, time: TimeColumn) -> pd.DatetimeIndex | pd.TimedeltaIndex | None:
    """Dates or times of a day; None where they, or most of a column of text, are numbers.

    Raises FileError where a day cannot be told from a month, and for what is no time.
    """
    name, column = time.column, table.column(time.column)
    if column.dtype.kind in "mM":
        return pd.Index(column)
    if column.dtype.kind not in "OUT" or time.unit is not None:
        return None
    text = pd.Series(column).astype("string").str.strip().str.replace(",", ".")
    text = text.str.replace(WHOLE, r"\1.0", regex=True)
    if pd.to_numeric(text, errors="coerce").notna().sum() >= text.notna().sum() / 2:
        return None
    first = text.dropna()[:1]
    found = [pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")]
    if found[0].isna().all():
        forms = [form for form in FORMS
                 if pd.to_datetime(first, format=form, errors="coerce").notna().all()]  # fmt: skip
        found += [pd.to_datetime(text, format=form, errors="coerce") for form in forms]
    most = max(stamps.notna().sum() for stamps in found)
    found = [stamps for stamps in found if stamps.notna().sum() == most]
    strange = np.flatnonzero(text.notna() & found[0].isna())
    if len(strange):
        what = "is neither a number nor a time, such as 2026-01-31T12:00:00.04"
        raise table.fault(strange[0], name, what)
    if any(not (stamps - stamps.min()).equals(found[0] - found[0].min()) for stamps in found):
        raise table.fault(0, name, "may be day or month first; write dates as 2026-01-31")
    stamps = pd.DatetimeIndex(found[0])
    if ":" in first.iloc[0][:3]:  # without a date: they go on after midnight
        days = np.cumsum(np.diff(stamps, prepend=stamps[:1]) < -pd.Timedelta(hours=12))
        stamps += pd.to_timedelta(days, "D")
    return stamps
