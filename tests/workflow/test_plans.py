"""What Snakemake plans of studies of every kind, and what their jobs read."""

from pkgutil import resolve_name

import pytest

from galloping.configuration.kinds import KINDS

TRIALS = ", ".join(f"{kind}: {{kind: {kind}}}" for kind in KINDS)
LINES = "internal_resonance: null, non_resonant: null"
OTHERS = [
    "measurement: {protocols: [displacement], levels: [0.3], joint_levels: [0]}",
    "{identification: {methods: [weak]}, measurement: {protocols: [state]}}",
    f"{{cases: {{{LINES}, alone: {{}}}}, identification: {{methods: [stlsq]}}}}",
    f"{{cases: {{{LINES}}}, trials: {{{TRIALS}}}}}",
    "cases: {non_resonant: {truth: {model: continuous, modes: 3}}}",
]
pytestmark = pytest.mark.xdist_group("plans")


@pytest.mark.parametrize("settings", ["{}", *OTHERS])
def test_a_study_of_any_kind_has_jobs_for_all_that_it_shows(jobs_of, settings):
    jobs = jobs_of(settings)
    assert "results/report.html" in jobs
    shown = [job["settings"] for job in jobs.values() if "function" in job["settings"]]
    assert shown and all(callable(resolve_name(s["function"]["function"])) for s in shown)


def test_tables_and_figures_are_of_what_is_in_a_study(jobs_of):
    jobs = jobs_of(
        "{cases: {internal_resonance: null, non_resonant: null}, trials: {a: {kind: systems}}}"
    )
    tables = {path for path in jobs if path.startswith("results/tables/")}
    names = ("columns", "systems", "paths", "reference_summary")
    assert tables == {f"results/tables/{name}.csv" for name in names}
    assert not any(path.startswith("results/figures/") for path in jobs)


def test_every_param_carries_its_key(jobs_of):
    """Else two numbers that swap would go unnoticed."""
    for job in jobs_of().values():
        for name, param in job["settings"].items():
            assert isinstance(param, dict) and (name == "code" or len(param) == 1), (job, name)
