"""Analysis of the files of a user: summary, tables and figures."""

# What an analysis writes, always all of it.
SHOWN = ("summary.md", "quality.svg", "fit.svg", "forecast.svg")  # in the report of a study
OUTPUTS = (
    "summary.md", "summary.json", "model.json", "model.csv", "forecast.csv", "datapackage.json",
    "quality.json",
    *(f"{figure}.{form}" for figure in ("quality", "fit", "forecast") for form in ("svg", "png")),
)  # fmt: skip
