"""Analysis of the files of a user: summary, tables and figures."""

# files in the report of a study
REPORT_OUTPUTS = ("summary.md", "quality.svg", "fit.svg", "forecast.svg")
OUTPUTS = (  # all files that an analysis writes
    "summary.md", "summary.json", "model.json", "model.csv", "forecast.csv", "datapackage.json",
    "quality.json",
    *(f"{figure}.{form}" for figure in ("quality", "fit", "forecast") for form in ("svg", "png")),
)  # fmt: skip
