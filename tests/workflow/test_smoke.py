"""The smoke study through Snakemake: what it writes, and that it is as it was when run again."""

import math

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

# What a reader or a script can count on; tables may have more.
COLUMNS = {
    "table1_conductor": "case value unit provenance",
    "table2_spacers": "case value unit provenance",
    "table3_coefficients": "case equation symbol term true identified relative_error_percent",
    "noise_coefficients": "case protocol method level order mean_error_percent",
    "noise_r2": "case protocol method level state r2_median r2_low r2_high failures",
    "data_amount": "case protocol method points state amplitude_error_percent r2",
    "claims": "claim quantity paper_value study_value low high met_by protocol method verdict",
    "paper": "claim case noise_level points direction printed median low high share_of_draws "
    "verdict reason",
    "reference_summary": "table rows_compared values_compared values_beyond_tolerance verdict",
}
CASES = {"internal_resonance", "non_resonant"}


def test_study_runs_to_the_end(study):
    assert study.first.returncode == 0, study.first.stdout


@pytest.mark.parametrize("name", COLUMNS)
def test_tables_have_the_columns_of_the_contract(study, name):
    rows = study.table(name)
    assert set(COLUMNS[name].split()) <= set(rows[0])
    if "case" in rows[0]:
        assert {row["case"] for row in rows} == CASES
    if "provenance" in rows[0]:
        assert {row["provenance"] for row in rows} <= {"seed", "derived", "inferred", "assumed"}


def test_models_without_noise_are_exact(study):
    rows = study.table("table3_coefficients")
    assert len(rows) == 2 * 14
    assert all(float(row["relative_error_percent"]) < 1e-4 for row in rows)


def test_every_cell_has_all_its_replicates(study):
    rows = study.table("scores")
    cells = {}
    for row in rows:
        key = tuple(row[k] for k in ("case", "protocol", "cell", "method"))
        cells.setdefault(key, []).append(int(row["replicate"]))
    assert {key[2] for key in cells} >= {"noise_0", "noise_0.05", "points_1000"}
    for key, replicates in cells.items():
        assert replicates == ([0] if key[2] == "noise_0" else [0, 1]), key


def test_claims_are_judged(study):
    rows = study.table("claims")
    verdicts = {row["verdict"] for row in rows}
    assert {"met", "not run"} < verdicts
    for row in rows:
        assert math.isfinite(float(row["paper_value"]))
        assert (row["study_value"] == "") == (row["verdict"] == "not run")
    exact = [r for r in rows if r["claim"].startswith("exact") and r["method"] == "stlsq"]
    assert exact and {row["verdict"] for row in exact} == {"met"}
    papers = study.table("paper")
    assert sum("in the same draw" not in row["claim"] for row in papers) == 34
    assert "not judged" not in {row["verdict"] for row in papers}


def test_figures_are_drawn(study):
    drawn = {path.stem for path in (study.results / "figures").glob("[!.]*.svg")}
    assert drawn >= {f"figure{i:02d}" for i in range(4, 11)}
    for name in drawn:
        svg, png = (study.results / "figures" / f"{name}.{form}" for form in ("svg", "png"))
        assert svg.read_text(encoding="utf-8").rstrip().endswith("</svg>")
        assert png.read_bytes().startswith(b"\x89PNG")


def test_every_job_leaves_a_log_and_a_benchmark(study):
    logs = {p.relative_to(study.results / "logs").with_suffix("")
            for p in (study.results / "logs").rglob("*.log")}  # fmt: skip
    benchmarks = {p.relative_to(study.results / "benchmarks").with_suffix("")
                  for p in (study.results / "benchmarks").rglob("*.tsv")}  # fmt: skip
    assert logs and logs == benchmarks


def test_second_run_has_nothing_to_do(study):
    before = study.files()
    run = study.snakemake()
    assert run.returncode == 0, run.stdout
    assert "Nothing to be done" in run.stdout
    assert study.files() == before


def test_a_bad_configuration_ends_in_one_line_and_writes_nothing(fresh, tmp_path):
    file = tmp_path / "edit.yaml"
    file.write_text("measurement: {subsets: {points: [30002]}}\n")
    before = fresh.files()
    run = fresh.snakemake(config=(str(file),))
    assert run.returncode != 0
    assert fresh.files() == before
    said = [text for text in run.stdout.splitlines() if not text.startswith(("Using ", "Config "))]
    assert said == [
        "measurement.subsets.points: 30002 is larger than the record (30001 samples)"
    ], run.stdout
