"""Kinds of trials that a study can name, without importing any of them.

`workflow/rules/evaluate.smk` names the function of each kind; their rows feed tables of
`workflow/rules/tables.smk`. `systems.csv` has the published systems, see `trials.published`.
"""

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from galloping.paper.unknowns import READINGS_BY_NAME

with Path(__file__).with_name("systems.csv").open(encoding="utf-8", newline="") as file:
    PUBLISHED = {row["name"]: row for row in csv.DictReader(file)}
# tables that summarise trials: of lines, of published systems, of lines outside the model class, of
# what the paper does not state; then comparisons with published shares and intervals
TRUST, SYSTEMS, MODEL_ERROR, PAPER = "trust", "systems", "model_error", "paper"
EXACT_TERMS, INTERVALS = "published_terms", "published_intervals"
EXAM = "exam"  # table of an exam, whose trials are its strata
DEFAULT_METHODS = ("maximum_likelihood",)  # methods in tables that do not distinguish methods
# s: duration of the longest published recording, by system
PUBLISHED_DURATIONS = {"lorenz": 10.0, "van_der_pol": 12.0, "rossler": 30.0}
# values of the quadratic coefficient of the relaxation, by name of the case
GAMMAS = {f"gamma {gamma:g}": gamma for gamma in (0.0, 0.02, 0.04, 0.08, 0.12, 0.16)}
# cases of `model_error` with the wind as an input, then the methods that accept inputs
WIND_CASES = ("9 modes, gusts 5 %, wind", "9 modes, gusts 10 %, wind", "two modes, gusts 5 %, wind")
INPUT_METHODS = ("maximum_likelihood", "weak_gls")
# tables of the examples and the mappings of their columns, by name
EXAMPLES = {name: (f"examples/{name}.csv", f"examples/{name}.yaml") for name in ("span", "gusts")}


@dataclass(frozen=True)
class Kind:
    """Kind of numerical experiment: its table of results, and the cases and methods it allows.

    table: which summarises its rows. cases: available ones; a batch is of one of them. methods:
    those compared by default. options: further keys, with their defaults. usable: methods that it
    can use, by default all.
    """

    table: str
    cases: tuple[str, ...]
    methods: tuple[str, ...] = DEFAULT_METHODS
    options: Mapping[str, tuple] = field(default_factory=dict)
    usable: tuple[str, ...] = ()


KINDS = {
    "default_line": Kind(
        TRUST,
        cases=("internal_resonance",),
        options={"protocols": ("state", "displacement"), "levels": (0.05, 0.1, 0.15)},
        usable=DEFAULT_METHODS,
    ),
    "random_lines": Kind(
        TRUST,
        cases=("all",),
        options={"protocols": ("state",), "levels": (0.05,), "durations": (300.0,)},
        usable=DEFAULT_METHODS,
    ),
    "sensor_faults": Kind(
        TRUST,
        cases=(
            "none", "clock", "velocity scale", "late channels", "random force", "gusts", "jitter",
            "multiplicative noise",
        ),
        options={"levels": (0.05,)},
        usable=DEFAULT_METHODS,
    ),
    "long_and_steady": Kind(
        TRUST,
        cases=(
            "2000 s", "10000 s", "100000 s", "limit cycle", "limit cycle, random lines",
            "sensitive lines",
        ),
        options={"levels": (0.05,)},
        usable=DEFAULT_METHODS,
    ),
    "systems": Kind(
        SYSTEMS,
        cases=tuple(PUBLISHED),
        methods=("maximum_likelihood", "weak_gls", "weak"),
        options={"levels": (0.01, 0.05, 0.1, 0.2), "samples": (500, 2000)},
    ),
    "model_error": Kind(
        MODEL_ERROR,
        cases=(
            "9 modes", "9 modes, relative wind", "9 modes, gusts 5 %", "9 modes, mid-span",
            "9 modes, displacement only", "two modes, gusts 2 %", "two modes, gusts 5 %",
            *WIND_CASES,
        ),
    ),
    "ambient": Kind(MODEL_ERROR, cases=("two modes in random forces",)),
    "free_decays": Kind(MODEL_ERROR, cases=("free decay with a second mode",)),
    "published_terms": Kind(
        EXACT_TERMS,
        cases=tuple(PUBLISHED_DURATIONS),
        options={"levels": (0.1, 0.2, 0.3, 0.4), "durations": (4.0, 7.0, 10.0)},
    ),
    "published_intervals": Kind(
        INTERVALS, cases=tuple(GAMMAS), options={"samples": (200, 800, 1600, 3200)}
    ),
    "files": Kind(
        EXAM,
        cases=(
            "limit cycle in micrometres", "limit cycle in minutes", "release after rest",
            "decay to rest", "decay with a knock", "dry friction", "large angles",
            "dry friction, its term asked for", "large angles, sine asked for", "angle that wraps",
            "two modes to rest", "unmeasured machine", "step of a force", "held force",
            "force of two values", *EXAMPLES,
        ),
        usable=INPUT_METHODS,
    ),
    "paper": Kind(PAPER, cases=tuple(READINGS_BY_NAME), methods=("paper",)),
}  # fmt: skip


def equal_effort(names: Iterable[str]) -> list[str]:
    """Select the trials named `readings...`, which give each reading one run, or else all."""
    every = list(names)
    return [name for name in every if name.startswith("readings")] or every
