"""The same bytes wherever and however a study is run."""

import pytest
from studies import copy_repository

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("copies")]

VARIED = ("logs", "benchmarks")  # with times in them
SOME = (  # of every stage
    "scores/non_resonant/state/points_1000.csv", "scores/internal_resonance/state/noise_0.05.csv",
    "tables/table3_coefficients.csv", "tables/limit_cycles.csv", "tables/clearance.csv",
    "tables/prediction.csv", "tables/resonance_map.csv", "figures/figure01.svg",
    "figures/limit_cycles.svg", "figures/galloping.gif",
)  # fmt: skip


def results(study):
    """Contents of all that the study makes, without what tells how it was made."""
    paths = {path.relative_to(study.results): path for path in study.results.rglob("[!.]*.*")}
    return {
        name: path.read_bytes()
        for name, path in paths.items()
        if path.is_file() and name.parts[0] not in VARIED
    }


def test_cores_place_time_zone_locale_and_hashes_change_no_byte(study, root, tmp_path):
    assert study.first.returncode == 0, "the smoke study failed: see test_smoke.py"
    other = type(study)(tmp_path / "another place")
    copy_repository(root, other.folder)
    run = other.snakemake(
        "--cores", "1", *(f"results/smoke/{name}" for name in SOME),
        TZ="Pacific/Kiritimati", LC_ALL="de_DE.UTF-8", PYTHONHASHSEED="1",
    )  # fmt: skip
    assert run.returncode == 0, run.stdout
    here, there = results(study), results(other)
    assert {str(path) for path in there} >= set(SOME)
    assert {path.parts[0] for path in there} >= {"identified", "bounds", "sweeps", "assessment"}
    assert [str(path) for path in there if here[path] != there[path]] == []
