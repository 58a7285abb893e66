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


def changed(jobs_of, settings):
    """The jobs of the default study that read other settings than before, or other files."""
    before = jobs_of()
    return {path for path, job in jobs_of(settings).items() if job != before.get(path)}


def test_a_threshold_is_read_by_the_family_of_its_method(jobs_of):
    read = changed(jobs_of, "identification: {stlsq: {threshold: 0.1}}")
    identified = {path for path in read if "/identified/" in path}
    assert identified and all(path.endswith("/sparse.npz") for path in identified)


def test_figures_alone_read_how_they_look(jobs_of):
    read = changed(jobs_of, "figures: {dpi: 100}")
    assert {path.split("/")[1] for path in read} == {"figures", "report.html"}


def test_the_wind_of_a_line_is_not_read_by_sweeps_of_the_wind(jobs_of):
    read = changed(jobs_of, "cases: {internal_resonance: {wind: {speed: 3.2}}}")
    assert "results/models/internal_resonance.json" in read
    assert not any("/sweeps/" in path for path in read)


def test_the_order_of_methods_is_read_by_what_shows_them(jobs_of):
    methods = "[maximum_likelihood, weak_gls, weak, ensemble, frols, stlsq, paper]"
    order = jobs_of(f"identification: {{methods: {methods}}}")
    # as Snakemake compares them, by the text of their values
    read = {p for p, job in jobs_of().items() if str(job) != str(order[p])}
    assert read and not {path.split("/")[1] for path in read} - {"tables", "figures", "report.html"}
