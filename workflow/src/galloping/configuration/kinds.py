"""The kinds of trials that a study can name, without importing any of them.

A kind is a function and an entry here; what it feeds is a table of `workflow/rules/tables.smk`.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from galloping.paper.unknowns import BY_NAME

with (Path(__file__).parents[1] / "trials/systems.csv").open(encoding="utf-8") as file:
    PUBLISHED = tuple(row["name"] for row in csv.DictReader(file))
# tables: of lines, of other systems, of lines that are not their own model, of what the paper
# leaves out, beside what others published of exact terms and of intervals
TRUST, SYSTEMS, MODEL_ERROR, PAPER = "trust", "systems", "model_error", "paper"
EXACT_TERMS, INTERVALS = "published_terms", "published_intervals"
# s, of the longest recordings that were published of each system
LONGEST = {"lorenz": 10.0, "van_der_pol": 12.0, "rossler": 30.0}
# quadratic coefficients of a relaxation
GAMMAS = {f"gamma {gamma:g}": gamma for gamma in (0.0, 0.02, 0.04, 0.08, 0.12, 0.16)}


@dataclass(frozen=True)
class Kind:
    """What is tried.

    function: `module:function`, imported only by the job that runs it. It takes `seed`, `case`,
    `replicates` (their numbers), `methods` (of `Method.settings`, by name) and the keywords
    `options`, and yields a row for each fit. table: in which its rows are summed up. cases: those
    there are; a batch is of one of them. methods: those that are compared by default. options:
    further keys that it takes, with their defaults.
    """

    function: str
    table: str
    cases: tuple[str, ...]
    methods: tuple[str, ...] = ("maximum_likelihood",)
    options: Mapping[str, tuple] = field(default_factory=dict)


KINDS = {
    "default_line": Kind(
        "galloping.trials.recorded_lines:of_the_default_line",
        TRUST,
        cases=("internal_resonance",),
        options={"protocols": ("state", "displacement"), "levels": (0.05, 0.1, 0.15)},
    ),
    "random_lines": Kind(
        "galloping.trials.recorded_lines:of_random_lines",
        TRUST,
        cases=("all",),
        options={"protocols": ("state",), "levels": (0.05,)},
    ),
    "sensor_faults": Kind(
        "galloping.trials.recorded_lines:of_faulty_recordings",
        TRUST,
        cases=(
            "none", "clock", "velocity scale", "late channels", "random force", "gusts", "jitter",
            "multiplicative noise",
        ),
        options={"levels": (0.05,)},
    ),
    "long_and_steady": Kind(
        "galloping.trials.recorded_lines:of_long_and_steady_motions",
        TRUST,
        cases=(
            "2000 s", "10000 s", "100000 s", "limit cycle", "limit cycle, random lines",
            "sensitive lines",
        ),
        options={"levels": (0.05,)},
    ),
    "systems": Kind(
        "galloping.trials.published:systems",
        SYSTEMS,
        cases=PUBLISHED,
        methods=("maximum_likelihood", "weak_gls", "weak"),
        options={"levels": (0.01, 0.05, 0.1, 0.2), "samples": (500, 2000)},
    ),
    "model_error": Kind(
        "galloping.trials.real_lines:trial",
        MODEL_ERROR,
        cases=(
            "9 modes", "9 modes, relative wind", "9 modes, gusts 5 %", "9 modes, mid-span",
            "9 modes, displacement only", "two modes, gusts 2 %", "two modes, gusts 5 %",
            "9 modes, gusts 5 %, wind", "9 modes, gusts 10 %, wind", "two modes, gusts 5 %, wind",
        ),
    ),
    "ambient": Kind(
        "galloping.trials.ambient:trial",
        MODEL_ERROR, cases=("two modes in random forces",)
    ),
    "published_terms": Kind(
        "galloping.trials.published:exact_terms",
        EXACT_TERMS,
        cases=tuple(LONGEST),
        options={"levels": (0.1, 0.2, 0.3, 0.4), "durations": (4.0, 7.0, 10.0)},
    ),
    "published_intervals": Kind(
        "galloping.trials.published:intervals",
        INTERVALS,
        cases=tuple(GAMMAS),
        options={"samples": (200, 800, 1600, 3200)},
    ),
    "paper": Kind(
        "galloping.trials.paper_search:trial",
        PAPER,
        cases=tuple(BY_NAME),
        methods=("paper",),
    ),
}  # fmt: skip
