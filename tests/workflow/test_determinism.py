"""Lost results come back with the same bytes, wherever and however a study is run."""

import shutil

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("copies")]

CASE = "non_resonant"  # whose results are lost, of every stage
SHOWN = ("figure01", "figure07", "limit_cycles")  # and these figures, and all tables
STAGES = {
    "models", "trajectories", "identified", "bounds", "oracles", "scores", "reconstructions",
    "sweeps", "assessment", "tables", "figures",
}  # fmt: skip


def lost(study):
    """What goes, by path below the results: of the case, the tables and some figures."""
    paths = {path.relative_to(study.results): path for path in study.results.rglob("[!.]*.*")}
    return {
        name: path
        for name, path in paths.items()
        if name.parts[0] in STAGES
        and path.is_file()
        and (CASE in str(name) or name.parts[0] == "tables" or path.stem in SHOWN)
    }


def test_cores_place_time_zone_locale_and_hashes_change_no_byte(study, tmp_path):
    assert study.first.returncode == 0, "the smoke study failed: see test_smoke.py"
    other = type(study)(tmp_path / "another place")
    shutil.copytree(study.folder, other.folder, symlinks=True)
    gone = lost(other)
    assert {name.parts[0] for name in gone} == STAGES
    for path in gone.values():
        path.unlink()
    run = other.snakemake(
        "--cores", "1", *(str(path.relative_to(other.folder)) for path in gone.values()),
        TZ="Pacific/Kiritimati", LC_ALL="de_DE.UTF-8", PYTHONHASHSEED="1",
    )  # fmt: skip
    assert run.returncode == 0, run.stdout
    here = lost(study)
    assert here.keys() == gone.keys()
    assert [str(name) for name in here if here[name].read_bytes() != gone[name].read_bytes()] == []
