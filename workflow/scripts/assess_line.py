"""Clearance of one line, its orbits, and what measures would do, with intervals."""

from contextlib import suppress

import numpy as np

from galloping.cycles.family import LIBRARY, initial_state, line_family
from galloping.cycles.motion import settle
from galloping.cycles.prediction import SAMPLES, split
from galloping.cycles.ranking import DAMPING, Design, derived, ranked
from galloping.cycles.rows import clearance_rows, measure_rows, places
from galloping.physics.equations import STATES
from galloping.physics.measures import measure, usual
from galloping.reproducibility.job import run
from galloping.seeds import generator
from galloping.simulation import Simulator
from galloping.storage import write_rows
from galloping.study.files import orbits
from galloping.study.kinds import OURS
from galloping.study.loading import load


def _measure(configured):
    given = {key: value for key, value in configured.items() if value is not None}
    return measure(given.pop("kind"), **given)


def main() -> None:
    settings, output, name = snakemake.params.settings, snakemake.output, snakemake.wildcards.case
    case, distance, limit = (settings[k] for k in ("case", "phase_distance", "clearance"))
    read = load(settings["reads"], dict(snakemake.input.items()))
    simulator = Simulator(STATES, LIBRARY)
    winds = sorted({*settings["winds"], settings["design_wind"]})
    rows = clearance_rows(name, case, winds, tuple(distance), limit, simulator)
    write_rows(output.clearance, rows)
    family, start = line_family(case, "wind_speed"), np.array(initial_state(case))
    settled = {wind: settle(simulator, family.model(wind), start) for wind in winds}
    finite = {wind: motion for wind, motion in settled.items() if motion.kind == "cycle"}
    orbits.write(output.orbits, {wind: places(motion) for wind, motion in finite.items()})
    parts = derived(case)
    draws = np.zeros((0, len(parts.values)))
    identified = read["identified"][OURS][settings["replicate"]] if read else None
    if identified is not None and len(identified.covariance):
        damping = {state: case["damping"][key] for state, key in DAMPING}
        with suppress(ValueError, np.linalg.LinAlgError):  # a model that tells no stiffness
            told = split([identified], [case["wind"]["speed"]], damping)
            draws = told.sampled(generator(settings["seed"], "measures", name), SAMPLES)
            parts = told
    chosen = [_measure(each) for each in settings["measures"]] or usual(case)
    design = Design(settings["design_wind"], start, tuple(distance), limit)
    outcomes = ranked(parts, case, chosen, design, simulator, draws)
    write_rows(output.measures, measure_rows(name, outcomes, design))


run(main, snakemake)
