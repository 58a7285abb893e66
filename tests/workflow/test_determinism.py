"""Lost results come back with the same bytes, wherever and however a study is run."""

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("copies")]

CASE, CELL = "non_resonant", "points_1000"
STAGES = {
    "models", "trajectories", "identified", "bounds", "scores", "reconstructions", "sweeps",
    "assessment", "tables", "figures",
}  # fmt: skip
LOST = (  # of every stage
    f"models/{CASE}.*", f"trajectories/{CASE}.*", f"identified/{CASE}/state/{CELL}/*",
    f"*/{CASE}/state/{CELL}.*", f"sweeps/{CASE}/**/*.csv", f"assessment/{CASE}/*",
    "tables/limit_cycles.csv", "tables/clearance.csv", "figures/limit_cycles.*",
    "figures/figure01.*",
)  # fmt: skip


def lost(study):
    """What goes, by path below the results."""
    paths = (path for pattern in LOST for path in study.results.glob(pattern))
    return {str(path.relative_to(study.results)): path for path in paths if path.name[0] != "."}


def test_cores_place_time_zone_locale_and_hashes_change_no_byte(study, tmp_path):
    other = study.copied(tmp_path / "another place")
    gone = lost(other)
    assert {name.partition("/")[0] for name in gone} == STAGES
    for path in gone.values():
        path.unlink()
    run = other.snakemake(
        "--cores", "1", *(str(path.relative_to(other.folder)) for path in gone.values()),
        TZ="Pacific/Kiritimati", LC_ALL="de_DE.UTF-8", PYTHONHASHSEED="1",
    )  # fmt: skip
    assert run.returncode == 0, run.stdout
    here = lost(study)
    assert [name for name in here if here[name].read_bytes() != gone[name].read_bytes()] == []
