"""Clearance and orbits of one line, and effects of measures against galloping, with intervals."""

from contextlib import suppress

import numpy as np

from galloping.cycles.family import LIBRARY, initial_state, line_family
from galloping.cycles.prediction import split
from galloping.cycles.ranking import Design, damping_ratios, derive_parts, places, rank_measures
from galloping.cycles.rows import clearance_rows
from galloping.cycles.settling import settle
from galloping.line.galerkin import STATES
from galloping.line.measures import MEASURE_KINDS, typical_measures
from galloping.reproducibility.job import run
from galloping.results import MAIN_METHOD
from galloping.storage import write_rows
from galloping.streams import make_generator
from galloping.study.files import read_families, write_orbits
from galloping.trajectory.simulation import Simulator


def assess_line(
    case, identified, clearance, measures, orbits, line, winds, design_wind, phase_distance, limit,
    chosen, seed,
):  # fmt: skip
    """Write tables of clearance and of measures against galloping, and orbits, of one line."""
    simulator, distance = Simulator(STATES, LIBRARY), tuple(phase_distance)
    winds = sorted({*winds, design_wind})
    family, start = line_family(line, "wind_speed"), np.array(initial_state(line))
    settled = {wind: settle(simulator, family.model(wind), start) for wind in winds}
    write_rows(clearance, clearance_rows(case, line, settled, distance, limit))
    cycles = {wind: motion.states for wind, motion in settled.items() if motion.kind == "cycle"}
    write_orbits(orbits, {wind: places(states) for wind, states in cycles.items()})
    parts = derive_parts(line)
    draws = np.zeros((0, len(parts.values)))
    for model in read_families(identified).get(MAIN_METHOD, [])[:1]:  # of the first replicate
        if not len(model.covariance):
            continue
        with suppress(ValueError, np.linalg.LinAlgError):  # a model that determines no stiffness
            identified_parts = split([model], [line["wind"]["speed"]], damping_ratios(line))
            draws = identified_parts.sampled(make_generator(seed, "measures", case))
            parts = identified_parts
    given = ({k: v for k, v in each.items() if v is not None} for each in chosen.values())
    compared = [MEASURE_KINDS[each.pop("kind")](**each) for each in given] or typical_measures(line)
    design = Design(design_wind, start, distance, limit)
    ranked = rank_measures(parts, line, compared, design, simulator, draws)
    write_rows(measures, [{"case": case, **row} for row in ranked])


if __name__ == "__main__":
    run(assess_line, snakemake)
