"""What each job of a study reads, of files and of settings: one function for each rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from galloping.configuration.trials import PAPER, TRUST
from galloping.field import SHOWN
from galloping.figures import registry as figures
from galloping.identification.registry import BY_NAME
from galloping.paper.printed import needed
from galloping.study import shown, sources
from galloping.study.cells import Study
from galloping.study.kinds import OURS_FAMILY, PAPER_METHOD
from galloping.study.sources import Source, Sources
from galloping.tables import registry as tables

ANIMATION = "galloping"  # the only figure that is not drawn on paper
MOST_VARIED_DRAWS = 40  # of each variant of a line, enough to tell most draws from some
ORACLE_REPLICATES = 5  # the first, of which the oracle of pysindy's settings is computed
CONTINUOUS = "galloping.measurement.continuous:motion"  # imports numba: not for all lines
HEADLINE = {  # tables that tell what was found of lines
    "efficiency": "efficiency",
    "errors": "noise_coefficients",
    "cycles": "limit_cycles",
    "bifurcations": "bifurcations",
}
RELEASE_HEIGHTS = [1.0, 2.0, 3.0]  # m, of the further recordings that are compared


@dataclass(frozen=True)
class Job:
    """What one job reads.

    inputs: paths by name. settings: plain values; editing others runs nothing again. modules: what
    its script imports by name.
    """

    inputs: Mapping[str, str]
    settings: Mapping
    modules: tuple[str, ...] = ()


def derive_model(study: Study, case: str) -> Job:
    """The modal equations of a line from its parameters."""
    return Job({}, {"line": study.case(case).line})


def simulate_line(study: Study, case: str) -> Job:
    """The true motion of a line after each release, of two modes or of the continuous line."""
    simulation, moving = study.settings.simulation, study.case(case)
    settings = {
        "releases": list(moving.releases),
        "duration": simulation.duration,
        "sampling_rate": simulation.sampling_rate,
    }
    if not moving.is_continuous:
        return _reading({"model": sources.model(study, case)}, settings)
    gusty = moving.truth["gusts"]["intensity"] > 0
    settings |= {
        "continuous": CONTINUOUS,
        "line": moving.line,
        "truth": moving.truth,
        "seed": study.settings.measurement.seed if gusty else 0,
    }
    return Job({}, settings, (CONTINUOUS,))


def rank_releases(study: Study, case: str) -> Job:
    """Which further release would tell most of the weakest term."""
    reads = {"model": sources.model(study, case), "trajectory": sources.trajectory(study, case)}
    level = study.settings.measurement.subsets.level
    return _reading(reads, {"level": level, "heights": RELEASE_HEIGHTS})


def measure_motion(study: Study, case: str, protocol: str, cell: str) -> Job:
    """The recordings of one cell, made where they are asked for."""
    measurement = study.cell(case, protocol, cell).measurement
    return _reading({"trajectory": sources.trajectory(study, case)}, {"measurement": measurement})


def identify_models(study: Study, case: str, protocol: str, cell: str, family: str) -> Job:
    """The models of all replicates of one cell by the methods of one family."""
    measured = study.cell(case, protocol, cell)
    methods = measured.families[family]
    settings = {
        "measurement": measured.measurement,
        "degree": study.settings.identification.degree,
        "methods": {method.name: study.options(method) for method in methods},
    }
    modules = tuple(module for method in methods for module in method.modules)
    return _reading({"trajectory": sources.trajectory(study, case)}, settings, modules)


def identify_recordings(study: Study, recording: str) -> Job:
    """From files of instruments to all that they tell, as `galloping identify` does."""
    settings = study.plain["recordings"][recording]
    files = {f"file_{k}": path for k, path in enumerate(settings["files"])}
    case = settings["case"]
    reads = {} if case is None else {"model": sources.model(study, case)}
    job = _reading(reads, {k: v for k, v in settings.items() if k != "publish"})
    return replace(job, inputs={**files, "mapping": settings["mapping"], **job.inputs})


def evaluate_cell(study: Study, case: str, protocol: str, cell: str) -> Job:
    """Scores, bounds and reconstructed motions of one cell."""
    measured = study.cell(case, protocol, cell)
    reads = {
        "model": sources.model(study, case),
        "trajectory": sources.trajectory(study, case),
        "identified": {
            family: sources.identified(study, measured, family) for family in measured.families
        },
    }
    settings = {
        "columns": measured.columns,
        "measurement": measured.measurement,
        "degree": study.settings.identification.degree,
        "steady_window": list(study.settings.simulation.steady_window),
        "is_continuous": measured.case.is_continuous,
    }
    return _reading(reads, settings)


def follow_cycles(study: Study, case: str, sweep: str) -> Job:
    """Equilibria, limit cycles and bifurcations of a line along a sweep."""
    along = study.sweep(sweep)
    settings = {
        "case": study.case(case).released,
        "parameter": along.parameter,
        "range": [along.values[0], along.values[-1]],
    }
    return Job({}, settings)


def simulate_sweep(study: Study, case: str, sweep: str, block: str) -> Job:
    """Long simulations of a line at one block of the values of a sweep."""
    along = study.sweep(sweep)
    values = next(each for each in along.blocks if each.name == block)
    settings = {
        "case": study.case(case).released,
        "parameter": along.parameter,
        "values": list(values.values),
        "second": along.second,
        "second_value": values.second,
    }
    return Job({}, settings)


def assess_line(study: Study, case: str) -> Job:
    """Clearance, orbits and measures, these with the intervals that an identification leaves."""
    assessment = study.plain["assessment"]
    cell = shown.assessed_cell(study, case)
    reads = {"identified": sources.identified(study, cell, OURS_FAMILY)} if cell else {}
    settings = {
        "case": study.case(case).released,
        "replicate": 0,
        "seed": study.settings.measurement.seed,
        **{key: assessment[key] for key in ("design_wind", "phase_distance", "clearance")},
        "winds": assessment["winds"],
        "measures": list(assessment["measures"].values()),
    }
    return _reading(reads, settings)


def predict_winds(study: Study, case: str, protocol: str) -> Job:
    """What models identified at one wind speed say of others."""
    cell = shown.predicted_cells(study, case)[protocol]
    settings = {
        "case": study.case(case).released,
        "winds": study.plain["assessment"]["winds"],
        "methods": shown.predicting_methods(cell),
        "seed": study.settings.measurement.seed,
    }
    reads = {"identified": {f: sources.identified(study, cell, f) for f in shown.families_of(cell)}}
    return _reading(reads, settings)


def redraw_paper(study: Study, case: str) -> Job:
    """Many draws of the paper's study by its own method, for its claims about one case."""
    draws = study.settings.measurement.paper_draws
    plan = {**_paper_plan(study, case), "draws": draws}
    return Job({}, {"case": study.case(case).released, "name": case, "plan": plan})


def vary_parameter(study: Study, parameter: str) -> Job:
    """What a setting that the paper leaves open decides of its claims about its first case."""
    case = study.case(shown.redrawn_cases(study)[0])
    draws = min(study.settings.measurement.paper_draws, MOST_VARIED_DRAWS)
    values = study.plain["assessment"]["open_parameters"][parameter]
    plan = {**_paper_plan(study, case.name), "draws": draws}
    settings = {"case": case.released, "name": case.name, "plan": plan}
    reads = {"drawn": sources.paper_draws(study, case.name)}
    return _reading(reads, {**settings, "parameter": parameter, "values": values})


def _paper_plan(study: Study, case: str) -> dict:
    """What claims about a case need of what the paper's study measures, without the draws."""
    measurement, simulation = study.settings.measurement, study.settings.simulation
    levels, points = needed(case, measurement.levels, measurement.subsets.points)
    amounts = {
        "levels": levels,
        "points": points,
        "subset_level": measurement.subsets.level,
        "duration": simulation.duration,
        "sampling_rate": simulation.sampling_rate,
        "steady_window": list(simulation.steady_window),
    }
    options = study.plain["identification"][PAPER_METHOD]
    return {
        "threshold": options["threshold"],
        "kinematics": options["kinematics"],
        "degree": study.settings.identification.degree,
        "seed": measurement.seed,
        "amounts": amounts,
    }


def animate_line(study: Study) -> Job:
    """The galloping span and its orbit, of the first case."""
    case = shown.first_case(study)
    wind = study.settings.assessment.design_wind
    return Job({}, {"case": case.released, "name": case.name, "wind": wind})


def find_oracle(study: Study, case: str, protocol: str, cell: str) -> Job:
    """The best that pysindy's methods could do on one cell, chosen with the truth."""
    measured = study.cell(case, protocol, cell)
    reads = {
        "model": sources.model(study, case),
        "trajectory": sources.trajectory(study, case),
    }
    replicates = min(ORACLE_REPLICATES, measured.replicates)
    settings = {
        "columns": measured.columns,
        "measurement": {**measured.measurement, "replicates": replicates},
        "degree": study.settings.identification.degree,
        "path_length": study.settings.identification.stlsq.path_length,
        "steady_window": list(study.settings.simulation.steady_window),
    }
    return _reading(reads, settings)


def run_trial(study: Study, trial: str, batch: str) -> Job:
    """One batch of the replicates of a trial of the verdicts."""
    tried = study.trial(trial)
    part = next(each for each in tried.batches if each.name == batch)
    methods = [BY_NAME[name] for name in tried.methods]
    settings = {
        "function": tried.kind.function,
        "seed": tried.seed,
        "case": part.case,
        "replicates": list(part.replicates),
        "methods": {method.name: study.options(method) for method in methods},
        "options": dict(tried.options),
    }
    modules = (tried.kind.function, *(module for method in methods for module in method.modules))
    return Job({}, settings, modules)


def make_table(study: Study, table: str) -> Job:
    """One table of `tables.registry`."""
    described = tables.BY_NAME[table]
    settings = {"function": described.function, "shown": dict(described.settings(study))}
    return _reading(described.reads(study), settings, (described.function,))


def draw_figure(study: Study, figure: str) -> Job:
    """One figure of `figures.registry`."""
    described = figures.BY_NAME[figure]
    settings = {
        "function": described.function,
        "shown": dict(described.settings(study)),
        "look": study.plain["figures"],
    }
    return _reading(described.reads(study), settings, (described.function,))


def compare_reference(study: Study) -> Job:
    """All tables that are compared, and those of the reference that there are."""
    names = [table.name for table in tables.of_study(study) if table.is_compared]
    folder = Path(study.settings.reference)
    kept = {name: folder / f"{name}.csv" for name in names}
    reads = {
        "tables": {name: sources.as_written(sources.table(study, name).path) for name in names},
        "reference": {n: sources.as_written(str(p)) for n, p in kept.items() if p.exists()},
    }
    if (origin := folder / "origin.json").exists():
        reads["origin"] = Source(str(origin), "galloping.tables.reference:read_origin")
    others = ("results", "reference", "recordings", "figures")  # on which no number depends
    settings = {"study": {k: v for k, v in study.plain.items() if v and k not in others}}
    return _reading(reads, settings)


def write_report(study: Study) -> Job:
    """Every figure and table with its caption, and what was found in the first case."""
    names = [*(each.name for each in tables.of_study(study) if each.is_shown), *tables.COMPARISONS]
    drawn = figures.of_study(study)
    paths = study.paths
    shows = {
        **{f"figures/{f.name}": paths.figure.format(figure=f.name, form="svg") for f in drawn},
        **{f"tables/{name}": paths.table.format(table=name) for name in names},
        **{
            f"recordings/{name}/{file}": paths.field.format(recording=name, file=file)
            for name in study.settings.recordings
            for file in SHOWN
        },
    }
    settings = {"labels": {each.name: each.label for each in drawn}, "study": study.plain}
    reads = {}
    if shown.has_trials(TRUST)(study):
        reads |= {"trust": sources.table(study, "trust")}
    if shown.has_trials(PAPER)(study):
        reads |= {"region": sources.table(study, "paper_region")}
    if shown.has_lines(study):
        shows |= {f"figures/{ANIMATION}": paths.animation}
        settings["labels"] |= {ANIMATION: "the span, moving"}
        reads |= {name: sources.table(study, table) for name, table in HEADLINE.items()}
        settings["headline"] = {
            "case": shown.first_case(study).name,
            "protocol": shown.sensor_protocol(study).name,
        }
    if shown.departures_from_paper(study):
        reads |= {"paper": sources.table(study, "paper")}
    if shown.redrawn_cases(study):
        reads |= {"varied": sources.table(study, "reproduction")}
    job = _reading(reads, settings)
    return replace(job, inputs={**shows, **job.inputs})


def _reading(reads: Sources, settings: Mapping, modules: tuple[str, ...] = ()) -> Job:
    """A job that reads its files by name: see `sources.load`."""
    named: dict[str, Source] = sources.flat(reads)
    return Job(
        {name: source.path for name, source in named.items()},
        {"reads": sources.readers(reads), **settings},
        (*modules, *sorted({source.reader for source in named.values()})),
    )
