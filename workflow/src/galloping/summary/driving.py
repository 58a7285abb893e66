"""Inputs of a model for simulation or forecast: constant values, and inputs from a file."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from galloping.cycles.settling import Pace
from galloping.model.polynomial import PolynomialModel
from galloping.readers.file_table import read_table
from galloping.readers.mapping import ColumnMapping, InputColumn, TimeColumn
from galloping.readers.proposal import PROPOSAL_ROWS, find_clock
from galloping.readers.series import read_series
from galloping.readers.units import UnitError, factor
from galloping.recording.samples import Input

if TYPE_CHECKING:
    from galloping.summary.analysis import Field

N_DEFAULT_VALUES = 9  # values in a range without a step
MAX_RANGE_VALUES = 200  # values in any range
STEP_ROUNDING = 1e-9  # tolerance of the length of a range, in steps
SIMULATED_PERIODS = 60  # length of a simulation, in slowest periods
SAMPLES_PER_PERIOD = 60  # samples of the fastest period


def read_model_inputs(
    model: str,
    names: Sequence[str],
    at: Sequence[str],
    path: str | None,
    time: str | None,
    kinds: Mapping[str, str],
    units: Mapping[str, str],
) -> dict[str, Input | float]:
    """Collect the inputs that drive a model: constants from option texts, others from a file.

    at: texts such as `U=12`, for constant values. model: for the message. time: the column of
    times. kinds: interpolation of inputs. units: of inputs in the model. Columns have the names of
    the inputs, with their units. Raises ValueError if an input is missing or is another quantity
    than in the model, and for files that cannot be read.
    """
    driving, missing = _parse_constants(at, names, path)
    if path is not None:
        clock = time or find_clock(read_table(path, None, None, PROPOSAL_ROWS), None, {}) or ""
        inputs = tuple(
            InputColumn.model_validate({"column": name, "between": kinds.get(name)})
            for name in missing
        )
        mapping = ColumnMapping.model_construct(
            time=TimeColumn(column=clock), channels=(), inputs=inputs
        )
        series = read_series(path, mapping)
        for name, unit in series.units.items():
            with suppress(UnitError):
                if factor(unit, units.get(name, unit)) == 1.0:
                    continue
            wanted = f"must be convertible to {units[name]}, the unit in {model}"
            raise ValueError(f"{path}: {name} is in {unit}; {wanted}")
        driving |= series.inputs
    elif missing:
        name = missing[0]
        raise ValueError(
            f"{model}: is driven by {name}; say what it is, held (--at {name}=VALUE) or in a file "
            "(--inputs FILE)"
        )
    return driving


def read_later_inputs(
    field: "Field", names: Sequence[str], at: Sequence[str], path: str | None
) -> dict[str, Input | float]:
    """Collect the inputs of a model for the time after the end of the last recording.

    at: texts such as `U=12`, for constant values. path: a file with the columns of the recording,
    on its clock. Raises ValueError if the recording lacks an input, and if only one of the files
    has dates.
    """
    mapping, recording = field.mapping, field.series[-1]
    columns = {one.name: one for one in mapping.inputs}
    for name in names:
        if name not in columns:
            raise ValueError(
                f"{recording.path}: the model is driven by {name}; say its column, --input {name}"
                "=COLUMN (inputs: in a mapping)"
            )
    driving, missing = _parse_constants(at, names, path)
    if path is None:
        return driving
    if mapping.rate and not mapping.time:
        raise ValueError(
            f"{path}: is on no clock with {recording.path}, the times of which are its rows; say "
            "which column counts samples, --time"
        )
    others = {"channels": (), "inputs": tuple(columns[name] for name in missing)}
    series = read_series(path, mapping.model_copy(update=others))
    if bool(series.start) != bool(recording.start):
        raise ValueError(
            f"{path}: has {'dates' if series.start else 'no dates'} for times, unlike "
            f"{recording.path}; must be one clock"
        )
    if (is_zoned := _has_zone(series.start)) != _has_zone(recording.start):
        raise ValueError(
            f"{path}: times have {'a' if is_zoned else 'no'} time zone, unlike those of "
            f"{recording.path}; must be one clock"
        )
    shift = series.origin - recording.origin
    return driving | {
        name: replace(one, time=one.time + shift) for name, one in series.inputs.items()
    }


def _has_zone(instant: str) -> bool:
    return re.search(r"[+-]\d\d:\d\d$", instant) is not None


def choose_sampling(
    model: PolynomialModel, start: np.ndarray, inputs: Mapping[str, Input | float]
) -> tuple[float, float]:
    """Choose a duration (s) and a sampling rate (Hz) that suit a model's motion from a state.

    They are multiples of the periods of small motions there, with inputs at their means.
    """
    means = {
        name: float(np.nanmean(one.values)) if isinstance(one, Input) else one
        for name, one in inputs.items()
    }
    pace = Pace.of(model.at(means), start)
    duration, rate = SIMULATED_PERIODS * pace.slow, SAMPLES_PER_PERIOD / pace.fast
    return float(f"{duration:.2g}"), float(f"{rate:.2g}")


def _parse_constants(
    at: Sequence[str], names: Sequence[str], path: str | None
) -> tuple[dict[str, Input | float], list[str]]:
    """Parse the constant values of inputs, by name, and list the other inputs.

    Raises ValueError for a range, and for a file of inputs, at `path`, if there are no others.
    """
    constants: dict[str, Input | float] = {}
    for name, value in parse_input_values(at, names).items():
        if isinstance(value, np.ndarray):
            raise ValueError(f"--at {name}: a range is of `galloping assess`; must be one value")
        constants[name] = value
    missing = [name for name in names if name not in constants]
    if path is not None and not missing:
        cause = f"--at and --inputs exclude each other for {', '.join(names)}"
        raise ValueError(f"--inputs {path}: {cause if names else 'the model has no inputs'}")
    return constants, missing


def parse_input_values(
    texts: Sequence[str], inputs: Sequence[str]
) -> dict[str, float | np.ndarray]:
    """Parse texts such as `U=12` or `U=8:16:0.5` to the value or range of each input, by name.

    Raises ValueError if a text has another form or names no input.
    """
    values_by_input: dict[str, float | np.ndarray] = {}
    for text in texts:
        name, _, numbers = (part.strip() for part in text.partition("="))
        if name not in inputs:
            has = f"has the inputs {', '.join(inputs)}"
            none = "has no inputs; identify it with an input, such as --input U=COLUMN"
            raise ValueError(f"--at {text}: the model {has if inputs else none}")
        if name in values_by_input:
            raise ValueError(f"--at {text}: {name} is given twice")
        try:
            values = [float(part) for part in numbers.split(":")]
        except ValueError:
            values = []
        low, high = (*values, *values, np.nan, np.nan)[:2]  # a single value is both
        step = values[2] if len(values) > 2 else (high - low) / (N_DEFAULT_VALUES - 1)
        if len(values) > 3 or not np.isfinite([low, high, step]).all() or low > high:
            raise ValueError(
                f"--at {text}: must be one value, {name}=12, or a range with or without a step, "
                f"{name}=8:16 or {name}=8:16:0.5"
            )
        if low == high:
            values_by_input[name] = low
            continue
        n_steps = (high - low) / step + STEP_ROUNDING if step > 0 else 0
        if not 1 <= n_steps < MAX_RANGE_VALUES:
            raise ValueError(f"--at {text}: must be 2 to {MAX_RANGE_VALUES} values")
        values_by_input[name] = low + step * np.arange(int(n_steps) + 1)
    return values_by_input
