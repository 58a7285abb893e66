"""The table of `config/reruns.md`: what each edit runs again.

By the plans of the study before and after the edit: a job runs again if its settings or code, or
its inputs, are others, or if a job before it does. That Snakemake runs these is tried once.
"""

import re
import shutil
import tempfile
from collections.abc import Callable
from fnmatch import fnmatch
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import plans
import pytest
import yaml
from snakemake.utils import update_config

from galloping.identification.registry import METHODS

PAGE = Path(__file__).parents[2] / "config" / "reruns.md"
HEADER = "| Edit | Rules that run again | Of which cells |"
DEFAULT_HEADER = "| Edit of the default study | Jobs that run again | Of these, identifications |"
FAMILIES = {method.family for method in METHODS}
CELL = re.compile(r"(noise|points|joint)_[\d.]+")
REPORT = "write_report"  # shows all of them, and is made again when one is


class Row(NamedTuple):
    edit: str
    rules: str
    cells: str


def table(header: str) -> list[list[str]]:
    """The cells of a table of the page, by its first line."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    start = lines.index(header)
    body = lines[start + 2 : lines.index("", start)]
    return [[part.strip() for part in line.split("|")[1:-1]] for line in body]


def rows() -> list[Row]:
    """The table of the smoke study, without the lines that only divide it."""
    parsed = [Row(*cells) for cells in table(HEADER)]
    return [row for row in parsed if not row.edit.startswith("**")]


# --- the edits, each of a copy of a finished study ---

Edit = Callable[[Path], None]


def settings(text: str, name: str = "smoke.yaml") -> Edit:
    """YAML merged over the settings of a study; lists are replaced."""

    def edit(folder):
        path = folder / "config" / name
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        update_config(content, yaml.safe_load(text))
        path.write_text(yaml.safe_dump(content), encoding="utf-8")

    return edit


def replaced(name: str, old: str, new: str) -> Edit:
    """Text that a file has once, replaced."""

    def edit(folder):
        text = (folder / name).read_text(encoding="utf-8")
        assert text.count(old) == 1, (name, old)
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")

    return edit


def appended(name: str, text: str) -> Edit:
    def edit(folder):
        with (folder / name).open("a", encoding="utf-8") as file:
            file.write(text)

    return edit


def module(name: str) -> str:
    return f"workflow/src/galloping/{name}"


def statement_added(name: str) -> Edit:
    """A statement more in a module, which counts as one in a function does."""
    return appended(module(name), "edited = True\n")


def upgraded(name: str) -> Edit:
    """The record of a newer version, found before the installed one."""

    def edit(folder):
        record = folder / plans.NEWER / f"{name}-99.0.dist-info"
        record.mkdir(parents=True)
        text = metadata.distribution(name).read_text("METADATA")
        newer = re.sub(r"(?m)^Version: .*$", "Version: 99.0", text, count=1)
        (record / "METADATA").write_text(newer, encoding="utf-8")

    return edit


def touched(*names: str) -> Edit:
    return lambda folder: [(folder / name).touch() for name in names]


# --- what stands in the table, and the edits that it is tried with ---

PHYSICS, REGISTRY = module("line/galerkin.py"), module("identification/registry.py")
NEW_METHOD = """METHODS = (
    Method(
        name="ridge", family="sparse", function=sparse.ridge.ridge, options=Thresholded,
        takes=(DERIVATIVES, ALL_STATES), needs_uniform=False,
    ),
"""
SETTINGS = {
    "the wind speed of the first case": "cases: {internal_resonance: {wind: {speed: 12.5}}}",
    "the wind speed of another case": "cases: {non_resonant: {wind: {speed: 12.5}}}",
    "an initial state of the first case":
        "cases: {internal_resonance: {initial_state: {q_v: 0.2}}}",
    "a case added": "cases: {strong_wind: {wind: {speed: 16}}}",
    "a noise level added between others": "measurement: {levels: [0, 0.03, 0.05]}",
    "a noise level added above the others": "measurement: {levels: [0, 0.05, 0.1]}",
    "a noise level removed": "measurement: {levels: [0]}",
    "the number of replicates": "measurement: {replicates: 3}",
    "the seed": "measurement: {seed: 1}",
    "a subset size added": "measurement: {subsets: {points: [1000, 2000]}}",
    "the noise level of the subsets": "measurement: {subsets: {level: 0.04}}",
    "a method added": "identification: {methods: [paper, stlsq, maximum_likelihood, lasso]}",
    "a method removed": "identification: {methods: [paper, stlsq]}",
    "the order of the methods": "identification: {methods: [maximum_likelihood, stlsq, paper]}",
    "two damping ratios swapped":
        "cases: {internal_resonance: {damping: {vertical: 0.0014, horizontal: 0.0016}}}",
    "the threshold of the paper's method": "identification: {paper: {threshold: 0.004}}",
    "a threshold of `stlsq`": "identification: {stlsq: {threshold: 0.01}}",
    "the degree of the library": "identification: {degree: 2}",
    "the steady window": "simulation: {steady_window: [210, 300]}",
    "the length of the record": "simulation: {duration: 310}",
    "the resolution of figures": "figures: {dpi: 100}",
}  # fmt: skip
MODULES = (
    "line/galerkin.py", "identification/sparse/stlsq.py", "evaluation/motion.py",
    "figures/errors.py", "tables/table3.py", "storage.py",
)  # fmt: skip
OTHERS = {
    "a comment, or the order of two keys": [replaced(
        "config/config.yaml",
        "  duration: 300 # s\n  sampling_rate: 100 # Hz\n",
        "  # a comment\n  sampling_rate: 1e2\n  duration: 300.0\n",
    )],
    "a colour in `figures/style.py`": [replaced(
        module("figures/style.py"), 'BAND = "#f2c46d"', 'BAND = "#f2c46e"')],
    "a script's own code: `rank_releases.py`": [replaced(
        "workflow/scripts/rank_releases.py", "heights=HEIGHTS):\n", "heights=HEIGHTS):\n    pass\n"
    )],
    "a method written and registered, not yet asked for": [
        appended(module("identification/sparse/ridge.py"), "def ridge(item, threshold): ...\n"),
        replaced(REGISTRY, "METHODS = (\n", NEW_METHOD),
    ],
    "a function body in a method that is not asked for": [
        statement_added("identification/sparse/lasso.py")],
    "a comment, a docstring or the layout of a module": [
        replaced(PHYSICS, '"""Galloping equations: ', '"""Words: '),
        replaced(PHYSICS, "= slope / ", "= (\n slope  # words\n) / "),
    ],
    "an error message where no number is computed: `reproducibility/job.py`": [replaced(
        module("reproducibility/job.py"), "The disk is full: ", "No space is left: ")],
    "a rule's message or a comment in a rule": [replaced(
        "workflow/rules/simulate.smk", '        "Deriving', '        # words\n        "Now deriving'
    )],
    "a caption of a figure": [appended("workflow/report/figures/figure05.rst", "Words.\n")],
    "another version of matplotlib": [upgraded("matplotlib")],
    "another version of pysindy": [upgraded("pysindy")],
    "a number in `results/reference`": [replaced(
        "results/reference/smoke/table2_spacers.csv",
        "internal_resonance,spacers.mass,m_s,4.8,", "internal_resonance,spacers.mass,m_s,4.9,")],
    "a script, module, rule file or result touched": [touched(
        PHYSICS, "workflow/scripts/derive_model.py", "workflow/rules/simulate.smk",
        "results/smoke/models/non_resonant.json",
        "results/smoke/identified/non_resonant/state/joint_0.05/sparse.json",
    )],
}  # fmt: skip
EDITS = {row: [settings(text)] for row, text in SETTINGS.items()} | OTHERS
for name in MODULES:
    row = f"a function body in `{name.removeprefix('identification/')}`"
    EDITS[row] = [statement_added(name)]


DEFAULT_EDITS = {
    "the threshold of the paper's method": settings(
        "identification: {paper: {threshold: 0.002}}", "config.yaml"),
    "a method removed": settings(
        "identification: {methods: [paper, frols, ensemble, weak, weak_gls, maximum_likelihood]}",
        "config.yaml"),
    "the seed": settings("measurement: {seed: 1}", "config.yaml"),
    "a noise level added": settings(
        "measurement: {levels: [0, 0.01, 0.03, 0.05, 0.08, 0.1, 0.15]}", "config.yaml"),
    "the wind speed of the first case": settings(
        "cases: {internal_resonance: {wind: {speed: 11}}}", "config.yaml"),
    "a caption of a figure": appended("workflow/report/figures/figure05.rst", "Words.\n"),
}  # fmt: skip


# --- what the table says, and what Snakemake does ---


class Output(NamedTuple):
    """A file that the study asks for. path: below the results."""

    rule: str
    path: Path
    pending: bool

    @property
    def names(self) -> dict[str, str]:
        """The case, cell and method that the path names, as far as it does."""
        kind, *parts = self.path.with_suffix("").parts
        most = {"tables": 0, "figures": 0, "reproduction": 0, "paper": 0, "sweeps": 1,
                "assessment": 1}.get(kind, 4)  # fmt: skip
        return dict(zip(("case", "protocol", "cell", "family"), parts[:most], strict=False))

    @property
    def job(self) -> str:
        """Its rule, of tables, figures and draws of the paper with the name."""
        shown = self.rule in ("make_table", "draw_figure", "redraw_paper")
        return f"{self.rule}:{self.path.stem}" if shown else self.rule


def kind(name: str) -> str:
    if CELL.fullmatch(name):
        return "cell"
    return "family" if name in FAMILIES else "case"


@pytest.fixture(scope="module")
def copied(root, planned):
    """Returns the plan of a study of a copy of the repository after edits."""

    def copied(*edits, config="config/smoke.yaml"):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            for name in ("config", "workflow"):  # with what Python compiled of it
                shutil.copytree(root / name, folder / name)
            shutil.copy(root / "Snakefile", folder)
            (folder / "results" / "smoke").mkdir(parents=True)
            (folder / "results" / "reference").symlink_to(root / "results" / "reference")
            for edit in edits:
                edit(folder)
            return planned(folder, *filter(None, [config]))

    return copied


def pending(before: list[dict], after: list[dict]) -> dict[str, bool]:
    """Whether a job runs again, by each of its outputs."""
    maker = {path: job for job in after for path in job["outputs"]}

    @cache
    def runs(path):
        job = maker[path]
        return job not in before or any(runs(p) for p in job["inputs"] if p in maker)

    return {path: runs(path) for path in maker}


@pytest.fixture(scope="module")
def before(copied):
    """The plan of the study as it is."""
    return copied()


@pytest.fixture(scope="module")
def edited(copied, before):
    """Makes edits in a copy of the repository; returns all outputs that it asks for then."""

    def outputs(*edits):
        after = copied(*edits)
        runs = pending(before, after)
        return [
            Output(job["rule"], Path(path).relative_to("results/smoke"), runs[path])
            for job in after
            for path in job["outputs"]
            if job["rule"] != REPORT
        ]

    return outputs


def quoted(text: str) -> list[str]:
    return re.findall(r"`([^`]+)`", text)


def matching(text: str, rules: set[str]) -> set[str]:
    """The rules that are quoted in a text, stars included; each must be there."""
    found = {pattern: {r for r in rules if fnmatch(r, pattern)} for pattern in quoted(text)}
    assert all(found.values()), f"no such rule: {found}"
    return set().union(*found.values())


def said(row: Row, outputs: list[Output]) -> set[Output]:
    """The outputs that a row of the table names."""
    rules = {output.job for output in outputs}
    some, _, others = row.rules.partition(" except ")
    assert quoted(some) or some in ("all", "nothing")
    wanted = rules if some == "all" else matching(some, rules)
    chosen = {o for o in outputs if o.job in wanted - matching(others, rules)}
    for which in ("case", "cell", "family"):
        if names := {name for name in quoted(row.cells) if kind(name) == which}:
            chosen = {o for o in chosen if which not in o.names or o.names[which] in names}
    return chosen


def judged(outputs: list[Output]) -> list[Output]:
    """Without tables and figures that no row names, as those that are new."""
    named = {name for row in rows() for name in quoted(row.rules)}
    return [output for output in outputs if ":" not in output.job or output.job in named]


def test_every_edit_has_a_row_and_every_row_an_edit():
    named = [row.edit for row in rows()]
    assert sorted(named) == sorted(EDITS)


ALIKE = {  # what another row shows too, tried among the slow tests
    "the wind speed of another case", "an initial state of the first case",
    "a noise level added above the others", "a noise level removed", "a method removed",
    "a threshold of `stlsq`", "a function body in `evaluation/motion.py`",
    "a function body in `figures/errors.py`", "a function body in `storage.py`",
    "a colour in `figures/style.py`", "another version of matplotlib", "the seed",
    "a subset size added", "the length of the record", "the degree of the library",
    "a function body in `tables/table3.py`", "two damping ratios swapped",
    "the threshold of the paper's method", "the noise level of the subsets", "the steady window",
    "another version of pysindy",
}  # fmt: skip
# only Snakemake knows what became of a file: here and in test_smoke.py
OF_FILES = ("a number in `results/reference`", "a script, module, rule file or result touched")


@pytest.mark.xdist_group("reruns")
@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, id=row.edit, marks=[pytest.mark.slow] * (row.edit in ALIKE))
        for row in rows()
        if row.rules != "nothing" and row.edit not in OF_FILES
    ],
)
def test_an_edit_runs_exactly_what_the_table_says(edited, row):
    outputs = judged(edited(*EDITS[row.edit]))
    run = {output for output in outputs if output.pending}
    assert run and run == {output._replace(pending=True) for output in said(row, outputs)}
    assert bool(row.cells) == any("case" in output.names for output in run)


@pytest.mark.xdist_group("reruns")
def test_what_changes_no_number_plans_nothing(edited):
    edits = [edit for row in rows() if row.rules == "nothing" for edit in EDITS[row.edit]
             if row.edit not in OF_FILES]  # fmt: skip
    assert len(edits) > 5 and not any(output.pending for output in edited(*edits))


@pytest.mark.xdist_group("reruns")
@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("figures/figure.mplstyle", "draw_figure"),
        ("identification/findings.csv", "identify_models"),
    ],
)
def test_data_beside_a_module_count_as_its_code(edited, name, rule):
    run = {output.rule for output in edited(appended(module(name), "\n")) if output.pending}
    assert rule in run


@pytest.mark.slow
@pytest.mark.xdist_group("reruns")
def test_edits_of_the_default_study_run_as_many_jobs_as_the_table_says(copied):
    before, found = copied(config=""), []
    for edit, make in DEFAULT_EDITS.items():
        after = copied(make, config="")
        runs = pending(before, after)
        again = [job for job in after if any(runs[path] for path in job["outputs"])]
        identified = sum(job["rule"] == "identify_models" for job in again)
        found.append([edit, f"{len(again)} of {len(after)}", str(identified)])
    assert table(DEFAULT_HEADER) == found


def dry_run(study, folder, *edits):
    """What Snakemake would run of a finished study after edits: outputs as `edited` gives them."""
    copy = study.copied(folder / "study")
    for edit in edits:
        edit(copy.folder)
    said = copy.ran("--summary").splitlines()
    lines = [line.split("\t") for line in said if line.count("\t") == 5]
    assert lines[0] == ["output_file", "date", "rule", "log-file(s)", "status", "plan"]
    return {
        Output(rule, Path(name).relative_to("results/smoke"), plan == "update pending")
        for name, _, rule, *_, plan in lines[1:]
        if rule != REPORT and not name.endswith(".receipt")
    }


@pytest.mark.slow
@pytest.mark.xdist_group("study")
def test_snakemake_runs_what_the_plans_say(study, edited, tmp_path):
    rows = ("a threshold of `stlsq`", "the wind speed of another case")
    edits = [edit for row in rows for edit in EDITS[row]]
    assert dry_run(study, tmp_path, *edits) == set(edited(*edits))


@pytest.mark.slow
@pytest.mark.xdist_group("study")
def test_what_runs_nothing_runs_nothing(study, tmp_path):
    # together: none of them can take back what another does
    edits = [edit for row in rows() if row.rules == "nothing" for edit in EDITS[row.edit]]
    outputs = dry_run(study, tmp_path, *edits)
    assert len(outputs) > 70 and len(edits) > 5
    assert [output for output in outputs if output.pending] == []


@pytest.mark.xdist_group("reruns")
def test_the_tutorial_shows_what_its_edit_runs_again(copied, before):
    page = PAGE.parents[1].joinpath("docs", "tutorial_study.md").read_text(encoding="utf-8")
    edit = page.split("# mine.yaml\n")[1].partition("```")[0]
    after = copied(settings(edit))
    runs = pending(before, after)
    jobs = sum(any(runs[path] for path in job["outputs"]) for job in after)
    assert f"\n{jobs} of {len(after)} jobs will run, " in page
    default = yaml.safe_load(PAGE.with_name("config.yaml").read_text(encoding="utf-8"))
    release = default["cases"]["internal_resonance"]["initial_state"]["q_v"]
    assert f"initial_state.q_v from {release} to " in page
