"""Limit cycles that identified models approach, compared with the true one and the recording."""

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
import pandas as pd

from galloping.cycles.prediction import limit_cycle_ahead
from galloping.evaluation.motion import steady_amplitude
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import Derived
from galloping.recording.measurement import Motion
from galloping.streams import make_generator

COLUMNS = (
    "case", "protocol", "level", "method", "state", "recorded_m", "true_m", "predicted_m",
    "low_m", "high_m", "coverage_95_percent", "n_limit_cycles", "replicates",
)  # fmt: skip
MAX_REPLICATES = 10  # replicates of a cell: each takes as many corrections as it has draws


def limit_cycles_ahead(
    model: Derived,
    trajectory: Sequence[Motion],
    identified: Mapping[str, Mapping[str, Sequence[IdentifiedModel]]],
    settings: Mapping,
) -> pd.DataFrame:
    """Tabulate limit-cycle amplitudes: predicted by identified models, true and recorded.

    There is a row for each cell and displacement. model, trajectory: of the line. identified: by
    cell and method. settings: method, seed; cells, each with its columns; steady_window, s, of the
    paper's "steady state"; is_continuous, whether the motion is not the model's, whose limit cycle
    then is not the true one. Columns as in COLUMNS: recorded_m is the amplitude of the motion in
    that window, predicted_m and its interval medians over the first replicates with a model.
    """
    first = trajectory[0]
    begin, end = settings["steady_window"]
    recorded = steady_amplitude(first.states[(first.time >= begin) & (first.time <= end)])
    true = np.full(len(first.names), np.nan)
    if first.status == "ok" and not settings["is_continuous"]:
        true_model = IdentifiedModel(model.model)
        with suppress(ValueError):  # a line that comes to rest has none
            true, *_ = limit_cycle_ahead(true_model, first.states[0], np.random.default_rng(0))
    rows = []
    for name, columns in settings["cells"].items():
        models, cycles = identified[name][settings["method"]][:MAX_REPLICATES], []
        for replicate, identified_model in enumerate(models):
            rng = make_generator(settings["seed"], "limit cycle ahead", name, replicate)
            with suppress(ValueError, np.linalg.LinAlgError):
                cycles.append(limit_cycle_ahead(identified_model, first.states[0], rng))
        cell = {key: columns[key] for key in ("case", "protocol", "level")}
        cell |= {"method": settings["method"], "replicates": len(models)}
        cell |= {"n_limit_cycles": len(cycles)}
        for k, state in enumerate(first.names[: len(first.names) // 2]):
            displacements = {"state": state, "recorded_m": recorded[k], "true_m": true[k]}
            rows.append(cell | displacements | _summarise_cell(cycles, k, true[k]))
    return pd.DataFrame(rows, columns=COLUMNS)


def _summarise_cell(cycles: Sequence, k: int, true: float) -> dict[str, float]:
    """Compute medians of one cell's predictions of a displacement, and their coverage."""
    predicted, low, high = np.reshape([[of[k] for of in cycle] for cycle in cycles], (-1, 3)).T
    has_interval = np.isfinite(low)
    median = {"predicted_m": predicted, "low_m": low[has_interval], "high_m": high[has_interval]}
    is_covered = (low <= true) & (true <= high)
    return {
        **{name: np.median(of) if len(of) else np.nan for name, of in median.items()},
        "coverage_95_percent": 100.0 * np.mean(is_covered[has_interval])
        if has_interval.any() and np.isfinite(true)
        else np.nan,
    }
