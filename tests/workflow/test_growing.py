"""A grid that grows computes what is new and changes no number; one that shrinks leaves no row.
Lost results come back with the same bytes, wherever and however a study is run.
"""

from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("copies")]

GROWN_SETTINGS = """
measurement: {levels: [0, 0.03, 0.05]}
sweeps: {resonance: {values: [8, 16, 4]}}
"""
OF_CELLS = ("models", "trajectories", "identified", "scores", "reconstructions")
TABLES = (
    "claims.csv", "efficiency.csv", "noise_coefficients.csv", "noise_r2.csv", "resonance_map.csv",
    "scores.csv", "table3_coefficients.csv",
)  # fmt: skip
SHOWN = [f"tables/{name}" for name in TABLES]


def files(study, *folders):
    """Content and time of the files below folders of the results, without receipts."""
    return {
        path.relative_to(study.results): (path.read_bytes(), path.stat().st_mtime_ns)
        for folder in folders
        for path in sorted((study.results / folder).rglob("*.*"))
        if path.is_file() and not path.name.startswith(".")
    }


def tables(study):
    return {name: (study.results / "tables" / name).read_bytes() for name in TABLES}


def ran(study, targets, *config):
    """The study, which may have further settings, as far as the targets."""
    study.ran(*(f"results/smoke/{name}" for name in targets), config=config)
    return study


def written(folder, text):
    path = folder / "edit.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def small(study, tmp_path_factory):
    """A copy of the finished study."""
    return study.copied(tmp_path_factory.mktemp("growing") / "study")


@pytest.fixture(scope="module")
def before(small):
    return files(small, "tables", *OF_CELLS)


@pytest.fixture(scope="module")
def grown(small, before, tmp_path_factory):
    """The same, run with one more noise level and one more tension, as far as some tables."""
    return ran(small, SHOWN, written(tmp_path_factory.mktemp("settings"), GROWN_SETTINGS))


def test_cells_and_values_that_were_there_are_not_computed_again(grown, before):
    after = files(grown, *OF_CELLS)
    old = {path: state for path, state in before.items() if path.parts[0] in OF_CELLS}
    assert {path: after[path] for path in old} == old
    new = after.keys() - old.keys()
    assert new and all("noise_0.03" in path.as_posix() for path in new)
    logs = sorted((grown.results / "logs/simulate_sweep").rglob("tension_*.log"))
    assert len(logs) == 2
    assert all("2 of 3 values are known" in log.read_text(encoding="utf-8") for log in logs)


def test_no_row_is_left_of_what_is_no_longer_asked_for(grown, before):
    assert any(b",0.03," in content for content in tables(grown).values())
    ran(grown, SHOWN)
    assert (grown.results / "identified/non_resonant/state/noise_0.03/likelihood.json").exists()
    assert tables(grown) == {name: before[Path("tables", name)][0] for name in TABLES}


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
    elsewhere = {"TZ": "Pacific/Kiritimati", "LC_ALL": "de_DE.UTF-8", "PYTHONHASHSEED": "1"}
    other.ran("--cores", "1", *(f"results/smoke/{name}" for name in gone), **elsewhere)
    here = lost(study)
    assert [name for name in here if here[name].read_bytes() != gone[name].read_bytes()] == []
