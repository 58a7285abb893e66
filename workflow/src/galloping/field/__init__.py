"""Recordings from the field: from files of an instrument to recordings of states."""

# What an analysis writes, always all of it.
SHOWN = ("summary.md", "quality.svg", "fit.svg", "forecast.svg")  # in the report of a study
OUTPUTS = (
    "summary.md", "model.json", "model.csv", "forecast.csv", "datapackage.json", "quality.json",
    *(f"{figure}.{form}" for figure in ("quality", "fit", "forecast") for form in ("svg", "png")),
)  # fmt: skip


class FileError(ValueError):
    """A file that cannot be used as it is; one line."""
