"""Which cells a study has, what their jobs read, and where their files are; without Snakemake."""

import subprocess
import sys

import numpy as np
import pytest

from galloping.configuration.load import load
from galloping.configuration.trials import KINDS
from galloping.figures import registry as figures
from galloping.importing import imported
from galloping.measurement.measuring import Motion
from galloping.physics.galerkin import Derived
from galloping.polynomial import PolynomialModel
from galloping.study import jobs, shown, sources
from galloping.study.cells import Study
from galloping.study.files import models, trajectories
from galloping.study.kinds import OPEN_PARAMETERS
from galloping.study.loading import load as load_sources
from galloping.tables import registry as tables


def study(**settings):
    return Study(load(settings))


@pytest.fixture(scope="module")
def default():
    return study()


def test_the_cells_of_the_default_study(default):
    assert len(default.cells) == 2 * 3 * (6 + 4) + 3
    cell = default.cell("non_resonant", "state", "joint_0.05")
    assert (cell.kind, cell.recordings, cell.samples, cell.level) == ("joint", 2, 30001, 0.05)
    assert default.cell("non_resonant", "state", "points_1000").samples == 1000
    families = default.cell("internal_resonance", "state", "noise_0").families
    assert {name: len(methods) for name, methods in families.items()} == {
        "sparse": 5, "likelihood": 2,
    }  # fmt: skip
    assert "weak" not in [m.name for m in default.cells[0].methods]  # exact states need none


def test_without_noise_replicates_are_one_and_draw_nothing(default):
    cell = default.cell("internal_resonance", "state", "noise_0")
    assert (cell.replicates, cell.seed, cell.relative) == (1, 0, False)
    seeded = study(measurement={"seed": 5})
    cell = ("internal_resonance", "derivative", "noise_0")
    assert jobs.measure_motion(default, *cell) == jobs.measure_motion(seeded, *cell)


@pytest.mark.parametrize(
    ("settings", "reads"),
    [
        ({"measurement": {"state_noise": "absolute"}}, {"state", "displacement"}),
        ({"measurement": {"replicates": 3}}, {"derivative", "state", "displacement"}),
        ({"identification": {"stlsq": {"threshold": 0.1}}}, set()),
        ({"figures": {"dpi": 100}}, set()),
    ],
)
def test_a_job_reads_only_settings_on_which_its_results_depend(default, settings, reads):
    other = study(**settings)
    cells = [("internal_resonance", p.name, "noise_0.05") for p in default.protocols]
    measured = {
        cell[1]
        for cell in cells
        if jobs.measure_motion(default, *cell) != jobs.measure_motion(other, *cell)
    }
    assert measured == reads


def test_a_threshold_is_read_by_the_family_of_its_method(default):
    other = study(identification={"stlsq": {"threshold": 0.1}})
    cell = ("internal_resonance", "state", "noise_0.05")
    changed = [
        family
        for family in ("sparse", "likelihood")
        if jobs.identify_models(default, *cell, family)
        != jobs.identify_models(other, *cell, family)
    ]
    assert changed == ["sparse"]


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"measurement": {"protocols": ["displacement"], "levels": [0.3], "joint_levels": [0]}},
        {"identification": {"methods": ["weak"]}, "measurement": {"protocols": ["state"]}},
        {"cases": {"alone": {}}, "identification": {"methods": ["stlsq"]}},
        {"cases": {}, "trials": {kind: {"kind": kind} for kind in KINDS}},
    ],
)
def test_every_table_and_figure_reads_what_some_job_writes(settings):
    described = study(**settings)
    paths = described.paths
    written = {paths.model.format(case=case.name) for case in described.cases}
    written |= {paths.trajectory.format(case=case.name) for case in described.cases}
    written |= {paths.ranking.format(case=case.name) for case in described.cases}
    written |= {paths.table.format(table=table.name) for table in tables.of_study(described)}
    for cell in described.cells:
        named = (paths.bounds, paths.scores, paths.reconstructions)
        written |= {path.format(**cell.wildcards) for path in named}
        written |= {paths.oracle.format(**cell.wildcards)} if cell.name != "noise_0" else set()
        written |= {
            paths.identified.format(**cell.wildcards, family=family) for family in cell.families
        }
    for case in described.cases:
        assessed = (paths.clearance, paths.measures, paths.orbits)
        written |= {path.format(case=case.name) for path in assessed}
        for sweep in described.sweeps:
            names = {"case": case.name, "sweep": sweep.name}
            followed = (paths.cycles, paths.bifurcations)
            written |= {path.format(**names) for path in followed}
            written |= {paths.block.format(**names, block=block.name) for block in sweep.blocks}
        for protocol in shown.predicted_cells(described, case.name):
            written.add(paths.prediction.format(case=case.name, protocol=protocol))
    for trial in described.trials:
        written |= {paths.trial.format(trial=trial.name, batch=b.name) for b in trial.batches}
    written |= {paths.paper_draws.format(case=name) for name in shown.redrawn_cases(described)}
    written |= {paths.openness.format(parameter=name) for name in OPEN_PARAMETERS}
    written.add(str(sources.REGION))  # kept with the project: `make paper` infers it
    read = [jobs.make_table(described, table.name) for table in tables.of_study(described)]
    read += [jobs.draw_figure(described, figure.name) for figure in figures.of_study(described)]
    for job in read:
        assert set(job.inputs.values()) <= written
        assert all(callable(imported(module)) for module in job.modules)


def test_a_study_has_tables_and_figures_of_what_is_in_it(default):
    alone = study(cases={}, trials={"a": {"kind": "systems"}})
    assert [table.name for table in tables.of_study(alone)] == ["columns", "systems", "paths"]
    assert figures.of_study(alone) == []
    assert not {"fits", "trust", "systems", "paths"} & {t.name for t in tables.of_study(default)}


def test_more_replicates_of_a_trial_are_further_batches():
    def batches(replicates):
        trial = {"kind": "sensor_faults", "cases": ["late channels"], "replicates": replicates}
        described = study(trials={"a": trial})
        return {b.name: jobs.run_trial(described, "a", b.name) for b in described.trials[0].batches}

    few, more = batches(20), batches(25)
    assert list(few) == ["late_channels_0_to_9", "late_channels_10_to_19"]
    assert few == {name: more[name] for name in few}
    assert set(more) - set(few) == {"late_channels_20_to_24"}
    assert more["late_channels_20_to_24"].settings["replicates"] == [20, 21, 22, 23, 24]


def test_registries_import_neither_figures_nor_methods():
    code = (
        "import sys; from galloping.figures import registry; from galloping.study import jobs;"
        "print([m for m in ('matplotlib', 'pysindy', 'pandas', 'heyoka', 'numba', 'snakemake')"
        " if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_sources_are_read_by_name(tmp_path):
    motion = Motion(("a", "b"), np.arange(3.0), np.eye(3)[:, :2], np.ones((3, 2)), "ok")
    trajectories.write(tmp_path / "t.npz", [motion, motion])
    reader = "galloping.study.files.trajectories:read"
    described = {
        "one": sources.Source(str(tmp_path / "t.npz"), reader),
        "many": {"x": sources.Source(str(tmp_path / "t.npz"), reader)},
    }
    paths = {name: source.path for name, source in sources.flat(described).items()}
    read = load_sources(sources.readers(described), paths)
    for motions in (read["one"], read["many"]["x"]):
        assert len(motions) == 2 and motions[0].names == ("a", "b")
        assert np.array_equal(motions[1].states, motion.states)


def test_a_model_comes_back_to_the_last_bit(tmp_path):
    """Also one that is not the two-mode line."""
    values = np.array([[0.0, 1 / 3], [-1e-17, np.pi]])
    written = Derived(PolynomialModel(("x", "y"), ((1, 0), (0, 3)), values), {"a": 1 / 7}, {"m": 2})
    models.write(tmp_path / "model.json", written)
    read = models.read(tmp_path / "model.json")
    assert (read.model.states, read.model.terms) == (written.model.states, written.model.terms)
    assert np.array_equal(read.model.coefficients, values)
    assert (read.coefficients, read.quantities) == ({"a": 1 / 7}, {"m": 2})
