"""Layout of a text table: first row of data, separator of columns, and row of names."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from galloping.fields import list_first
from galloping.readers import MAX_LISTED_NAMES, FileError
from galloping.readers.columns import is_time, measured_quantity
from galloping.readers.units import is_unit, split_header

SEPARATORS = (";", "\t", ",", "|", None)  # None: white space; a comma may be a decimal mark
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
DECIMAL_POINT = re.compile(DECIMAL_COMMA.pattern.replace(",", r"\."))
MINUS = "\N{MINUS SIGN}"  # as some locales of Europe write it
COMMENT_MARKS = ("#", "%")
THOUSANDS_COMMA = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")  # or a number with a decimal comma
INSTANT = re.compile(  # a date or a time of a day; any text without a separator may follow
    r"(\d+[-/.:]\d+[-/.:]|\d\d?[- ][A-Za-z]{3}[- ]\d)\d[^,;\t]*(,\d+)?"
)
DECIMAL_HINT = "with a decimal comma say --decimal , (decimal: ',' in a mapping)"
MAX_COLUMNS = 10_000  # columns of a table
MAX_JOINED_LINES = 8  # lines of one quoted cell
MIN_DATA_ROWS = 3  # consecutive rows of numbers; shorter runs may belong to a header
# first cells that describe a row above the numbers and belong to no column
ROW_LABELS = {"name", "names", "channel", "channels", "kanal", "signal", "label", "sensor", "title"}
UNITS_LABEL = re.compile(r"(?:[xy]_)?(?:unit|einheit)\w*\W*", re.IGNORECASE)
UNITS_PREFIX = re.compile(  # in the first cell of a row, as in `# units: s, mm`
    r"[#%\s]*(?:unit|einheit)\w*\s*[:=] *(?=[^\s,;])", re.IGNORECASE
)
LOGGER_UNITS = {"ts", "rn"}  # Campbell's units of time stamps and record numbers
SHORT_TIME_UNITS = {"s", "ms", "us", "µs", "ns", "sec"}  # `min` may be a minimum
REMARKS = {"comment", "comments", "remark", "kommentar", "bemerkung"}  # columns that may be empty


@dataclass(frozen=True)
class Layout:
    """Layout of a text table: separator, decimal mark, names, units and first row of data.

    separator: between the columns; None is white space. header, units: a name and a unit, or None,
    for each column; '' is the name of a column without one. first: index of the first row of data,
    rows in quotes counted once. line: number of the line where that row begins, as an editor
    counts. notes: a line for each ignored part.
    """

    separator: str | None
    decimal: str
    header: list[str]
    units: list[str | None]
    first: int
    line: int
    notes: tuple[str, ...]


def find_layout(lines: list[str], decimal: str | None, time: str | None) -> Layout:
    """Find separator, decimal mark, header and first data row of a table from its first lines.

    Most rows have the same number of cells, two or more. The row of names is the row of text next
    to the numbers whose cells all differ; without a row of text above the numbers, columns are
    named by their place. decimal: the decimal mark; by default found from the cells. time: the
    column of times, which the row of names must have. Raises FileError if no separator fits, or if
    it is unclear which row names the columns.
    """
    rows, starts = _join_quoted(lines)
    filled_rows = [k for k, row in enumerate(rows) if row.strip(" ,;\t\r")]
    plain = [k for k in filled_rows if not rows[k].startswith(COMMENT_MARKS)]
    if not plain:
        raise FileError("no header")
    separator, columns = _find_separator(rows, plain, decimal)
    if columns > MAX_COLUMNS:
        raise FileError(f"{columns} columns are more than {MAX_COLUMNS}")
    cells = {k: _split_row(rows[k], separator, columns) for k in filled_rows}
    whole = [k for k in plain if len(cells[k]) == columns]
    notes = []
    if decimal is None:
        decimal = _find_decimal(c for k in whole for c in cells[k])
        if decimal == ",":
            notes.append("commas were read as decimal marks")
    first = _find_first_row(cells, plain, columns, decimal)
    head_rows = [k for k in filled_rows if first is None or k < first]
    data = [cells[k] for k in whole if first is not None and k >= first]
    empty = [not any(row[j] for row in data) for j in range(columns)] if data else []
    is_numbered = [row[0] for row in data] == [str(k + 1) for k in range(len(data))]
    fitted_cells = {
        k: row
        for k in head_rows
        if (row := _fit_row(cells[k], columns, empty, is_numbered)) is not None
    }
    units_row = _find_units(fitted_cells, cells)
    candidates = {
        k: _fill_names(row, fitted_cells.get(k - 1, []))
        for k, row in fitted_cells.items()
        if k != units_row
    } or fitted_cells
    header = _find_header(candidates, time, decimal, starts)
    if header is None:
        if first is None:
            raise FileError("no header")
        _check_headless(cells, rows, starts, first, separator)
        names = [str(j + 1) for j in range(columns)]
        notes.append(f"no row names the columns: they are named by their place, 1 to {columns}")
    else:
        names = candidates[header]
        first = header + 1 if first is None else first
    unused = [starts[k] + 1 for k in plain if k < first and k not in (header, units_row)]
    if unused:
        notes.append(f"rows before the data were left out: {len(unused)}, from row {unused[0]} on")
    units: list[str | None] = [None] * columns
    if units_row is not None and units_row != header:
        row = fitted_cells[units_row]
        units = [None if UNITS_LABEL.fullmatch(c) else c.strip("[]()") or None for c in row]
    line = starts[first] + 1 if first < len(starts) else len(lines) + 1
    return Layout(separator, decimal, names, units, first, line, tuple(notes))


def split_cells(row: str, separator: str | None) -> list[str]:
    """Split a row of text into stripped cells at a separator, or at white space if it is None."""
    if separator is None:
        row, separator = " ".join(row.split()), " "
    cells = csv.reader([row], delimiter=separator, skipinitialspace=True)
    return [" ".join(cell.split()) for cell in next(cells, [])]


def _split_row(row: str, separator: str | None, columns: int) -> list[str]:
    """Split a row, if possible to one cell per column.

    Cells are behind a comment sign or a label of units, or between wide blanks.
    """
    prefix = UNITS_PREFIX.match(row)
    if prefix and (separator is not None or len(split_cells(row, None)) != columns):
        row = row[prefix.end() :]
    bare = row.lstrip("".join(COMMENT_MARKS))
    ways = [split_cells(bare, separator), split_cells(row.lstrip("#"), separator)]
    if separator is None:
        ways.append(re.split(r"\s{2,}", bare.strip()))
    return next((cells for cells in ways if len(cells) == columns), ways[0])


def _join_quoted(lines: list[str]) -> tuple[list[str], list[int]]:
    """Join the lines of cells in quotes; return the rows and the index of the first line of each.

    A quotation mark that is not closed within MAX_JOINED_LINES lines is a normal character.
    """
    rows, starts, k = [], [], 0
    while k < len(lines):
        row, end = lines[k], k + 1
        if row.count('"') % 2:
            for until in range(k + 2, min(k + MAX_JOINED_LINES, len(lines)) + 1):
                joined = " ".join(lines[k:until])
                if joined.count('"') % 2 == 0:
                    row, end = joined, until
                    break
        rows.append(row)
        starts.append(k)
        k = end
    return rows, starts


def _find_separator(
    rows: list[str], plain: list[int], decimal: str | None
) -> tuple[str | None, int]:
    """Find the separator of the columns, and their number.

    It is the mark with which most rows have the same number of cells, most cells are numbers, and
    the first whole row is a header. `csv.Sniffer` would choose decimal commas.
    """
    candidates = []
    for rank, separator in enumerate(SEPARATORS):
        if separator is not None and separator == decimal:
            continue
        split = [split_cells(rows[k], separator) for k in plain]
        last = split[len(split) // 2 :]
        columns, count = Counter(map(len, last)).most_common(1)[0]
        if columns > 1 and 2 * count > len(last):
            cells = [cell for row in last if len(row) == columns for cell in row if cell]
            share = sum(_is_number(cell, decimal) for cell in cells) / max(len(cells), 1)
            headed = any(
                len(_drop_empty_end(row)) in (columns, columns + 1) and not _is_data(row, decimal)
                for row in split
            )
            candidates.append((round(-2 * share), not headed, rank, separator, columns))
    if not candidates:
        raise FileError(
            f"row {plain[-1] + 1}: {rows[plain[-1]]!r:.60} is one column, or rows differ; columns "
            "must be parted by commas (without decimal commas), semicolons, tabs, bars or blanks"
        )
    return min(candidates, key=lambda each: each[:3])[3:]


def _find_decimal(cells: Iterable[str]) -> str:
    """Find the decimal mark: a comma if some cells can mean nothing else, and none a point."""
    cells = [cell.replace(MINUS, "-") for cell in cells]
    commas = [cell for cell in cells if DECIMAL_COMMA.fullmatch(cell)]
    is_decimal = not all(map(THOUSANDS_COMMA.fullmatch, commas))
    return "," if is_decimal and not any(map(DECIMAL_POINT.fullmatch, cells)) else "."


def _is_number(cell: str, decimal: str | None) -> bool:
    """Decide whether a cell is a number, with either decimal mark if None is given."""
    cell = cell.replace(MINUS, "-")
    if INSTANT.fullmatch(cell) or (decimal in (None, ",") and DECIMAL_COMMA.fullmatch(cell)):
        return True
    try:
        float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return False
    return True


def _is_data(row: Sequence[str], decimal: str | None) -> bool:
    """Decide whether a row begins with a number or a time."""
    first = next(filter(None, row), "0")
    return _is_number(first, decimal) or DECIMAL_COMMA.fullmatch(first) is not None


def _is_mostly_numbers(row: Sequence[str], decimal: str | None) -> bool:
    filled = list(filter(None, row))
    return 2 * sum(_is_data([cell], decimal) for cell in filled) > len(filled)


def _find_first_row(
    cells: Mapping[int, list[str]], plain: Sequence[int], columns: int, decimal: str
) -> int | None:
    """Find the index of the first row of data, None if there is none.

    It is the first of MIN_DATA_ROWS successive rows that begin with a number or, if there are none,
    that contain mostly numbers; else the first of the longest run.
    """
    longest = []
    for is_data in (_is_data, _is_mostly_numbers):
        runs: list[list[int]] = [[]]
        for k in plain:
            if len(cells[k]) == columns and is_data(cells[k], decimal):
                runs[-1].append(k)
            elif runs[-1]:
                runs.append([])
        long_run = next((run for run in runs if len(run) >= MIN_DATA_ROWS), None)
        if long_run:
            return long_run[0]
        longest.append(max(runs, key=len))
    return longest[0][0] if longest[0] else None


def _fit_row(
    row: Sequence[str], columns: int, empty: Sequence[bool], is_numbered: bool
) -> list[str] | None:
    """Extract one cell per column from a row above the numbers; None if they do not fit.

    A trailing separator, a label before the cells, as in a row `NAME`, and a column of remarks that
    the rows do not have are left out. empty: whether each column has no samples. is_numbered:
    whether the first column numbers the rows; R gives it no name.
    """
    cells = _drop_empty_end(row)
    if len(cells) == columns + 1 and _is_label(cells[0]):
        cells = cells[1:]
    elif len(cells) == columns + 1 and cells[-1].casefold() in REMARKS:
        cells = cells[:-1]
    short = columns - len(cells)
    if not cells or short < 0:
        return None
    if short == 0 or len(row) == columns or (empty and all(empty[len(cells) :])):
        return cells + [""] * short
    return ["", *cells] if short == 1 and is_numbered else None


def _drop_empty_end(row: Sequence[str]) -> list[str]:
    cells = list(row)
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _is_label(cell: str) -> bool:
    is_label = cell.casefold().strip(" :#=") in ROW_LABELS | REMARKS
    return is_label or bool(UNITS_LABEL.fullmatch(cell))


def _find_units(
    fitted_cells: Mapping[int, list[str]], cells: Mapping[int, list[str]]
) -> int | None:
    """Find the index of the row of units nearest to the numbers.

    It has such a label, it begins with a unit of times, or most of its cells are units and not all
    are names.
    """

    def is_units(k: int) -> bool:
        if UNITS_LABEL.fullmatch(cells[k][0]):
            return True
        filled = [bare for cell in fitted_cells[k] if (bare := cell.strip("[]()"))]
        if any(split_header(cell)[1] and not is_unit(cell) for cell in fitted_cells[k]):
            return False
        if filled and filled[0] in SHORT_TIME_UNITS:
            return True
        n_units = sum(is_unit(cell) or cell.casefold() in LOGGER_UNITS for cell in filled)
        return _count_known_names(fitted_cells[k]) < len(filled) <= 2 * n_units

    return next((k for k in sorted(fitted_cells, reverse=True) if is_units(k)), None)


def _fill_names(names: Sequence[str], upper_names: Sequence[str]) -> list[str]:
    """Fill cells without a name, or with a unit of times, from known names in the row above."""
    filled = list(names)
    for j, (name, upper) in enumerate(zip(names, upper_names, strict=False)):
        if name in SHORT_TIME_UNITS | {""} and _count_known_names([upper]):
            filled[j] = f"{upper} [{name}]" if name else upper
    return filled


def _count_known_names(row: Sequence[str]) -> int:
    """Count the different cells of a row that a reader knows as names of columns."""
    known = (is_time(cell) or measured_quantity(cell) or split_header(cell)[1] for cell in set(row))
    return sum(map(bool, known))


def _find_header(
    candidates: Mapping[int, list[str]], time: str | None, decimal: str, starts: Sequence[int]
) -> int | None:
    """Find the index of the row of names, None if no row is one of text.

    It is the row that has the column of times or, if that is not given, the row whose cells all
    differ; of several the one with the most names that a reader knows, then the nearest to the
    numbers. Raises FileError if several rows of text have equal cells.
    """
    if time is not None:
        name = split_header(time)[0]
        time_rows = [
            k for k, row in candidates.items() if name in (split_header(c)[0] for c in row)
        ]
        if time_rows:
            return max(time_rows, key=lambda k: _count_known_names(candidates[k]))
    text = {
        k: row for k, row in candidates.items() if not any(_is_number(c, decimal) for c in row if c)
    } or {k: row for k, row in candidates.items() if not _is_data(row, decimal)}
    if not text:
        return None

    def differs(row: Sequence[str]) -> bool:
        cells = _drop_empty_end(row)
        return len(set(cells)) == len(cells)

    name_counts = {k: _count_known_names(row) for k, row in text.items()}
    best = max(text, key=lambda k: (name_counts[k] > 1, differs(text[k]), name_counts[k], k))
    if len(text) > 1 and not differs(text[best]) and name_counts[best] < 2:
        rows = list_first([str(starts[k] + 1) for k in text], MAX_LISTED_NAMES)
        raise FileError(
            f"rows {rows} look like names of columns, and each has cells that are alike; keep one "
            "of them, with a name of its own for each column"
        )
    return best


def _check_headless(
    cells: Mapping[int, list[str]],
    rows: Sequence[str],
    starts: Sequence[int],
    first: int,
    separator: str | None,
) -> None:
    """Raise FileError if the row next to the numbers looks like names, with another count."""
    head_cells, columns = cells.get(first - 1, []), len(cells[first])
    if len(head_cells) < 2 or rows[first - 1].startswith(COMMENT_MARKS):
        return
    halved = separator == "," and columns == 2 * len(head_cells)
    hint = f"; {DECIMAL_HINT}, and another separator between columns" if halved else ""
    raise FileError(
        f"row {starts[first - 1] + 1}, the header, has {len(head_cells)} cells, row "
        f"{starts[first] + 1} has {columns}{hint}"
    )
