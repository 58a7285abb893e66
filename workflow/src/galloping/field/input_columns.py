"""Inputs of files: from a column to a function of time, its unit, and where it is not known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from galloping.field.units import UnitError, input_si
from galloping.inputs import GAP, Input

if TYPE_CHECKING:
    from galloping.field.file_table import FileTable
    from galloping.field.mapping import InputColumn
    from galloping.field.read import Series
    from galloping.polynomial import Exponents, PolynomialModel
    from galloping.recording import Recording

BETWEEN = {
    "zero": "held between samples", "linear": "linear between samples",
    "cubic": "smooth between samples",
}  # fmt: skip
VALUES, MOST_VALUES = 9, 200  # of a range, where no step is said; and at all
HELD = 2  # rows, that a logger repeats a slower sample for at least


def input_unit(table: FileTable, column: InputColumn) -> tuple[float, str]:
    """What the values of an input are multiplied by, and the SI unit that they are in then."""
    own, said = table.unit(column.column), column.unit
    if not (own or said):
        raise ValueError(
            f"{table.path}: column {column.column!r} has no unit; add --unit {column.column}=m/s, "
            "or whatever it is in, or write it behind the name of the column, in brackets"
        )
    try:
        if own and said and input_si(own) != input_si(said):
            raise UnitError(f"is in {own} by the file and in {said} by the mapping; must be one")
        return input_si(said or own)
    except UnitError as error:
        raise ValueError(f"{table.path}: column {column.column!r}: {error}") from None


def inputs_of(
    path: Path, columns: Sequence[InputColumn], time: np.ndarray, values: np.ndarray
) -> dict[str, Input]:
    """Inputs by name, from values (n, n_inputs) at the rows of a file.

    Rows between the samples of a slower instrument, empty or repeated, are no gaps and no samples.
    Raises ValueError where a column holds fewer than two samples.
    """
    found = {}
    for column, own in zip(columns, values.T, strict=True):
        known = np.flatnonzero(np.isfinite(own))
        if len(known) < 2:
            raise ValueError(f"{path}: column {column.column!r} has {len(known)} samples")
        if column.between != "zero":
            known = known[_fresh(own[known])]
        steps = np.diff(time[known])
        kept = np.zeros(len(own), bool)
        kept[known] = True
        for k in np.flatnonzero(steps > GAP * np.median(steps)):
            kept[known[k] : known[k + 1]] = True
        found[column.name] = Input(
            time[kept] - column.delay, own[kept], column.between, column.error
        )
    return found


def _fresh(values: np.ndarray) -> np.ndarray:
    """(n,) boolean: the samples of a slower instrument that a logger did not merely repeat.

    All where values do not stay for a fixed number of rows.
    """
    fresh = np.append(True, np.diff(values) != 0)
    runs = np.diff(np.flatnonzero(fresh))
    if len(runs) < HELD or np.median(runs) < HELD:
        return np.ones(len(values), bool)
    regular = runs % np.median(runs) == 0
    return fresh if regular.mean() > 0.9 else np.ones(len(values), bool)


def input_notes(recording: Recording) -> list[str]:
    """A line for each input that is not known all through the motion."""
    time = recording.time
    steps = np.diff(time, append=time[-1])
    steps = np.where(steps > GAP * np.median(steps), 0.0, steps)  # of the time with samples
    return [
        f"input {name} is not known for {steps[gone].sum():.1f} s, "
        f"{100 * gone.mean():.2g} % of the samples: left out"
        for name, one in recording.inputs.items()
        if (gone := ~one.covered(time)).any()
    ]


def described(series: Series, columns: Sequence[InputColumn]) -> dict[str, dict]:
    """What inputs are like, by column, as plain values."""
    found = {}
    for column in columns:
        one = series.inputs[column.name]
        known = one.values[np.isfinite(one.values)]
        found[column.column] = {
            "name": column.name,
            "unit": series.units[column.name],
            "mean": float(known.mean()),
            "standard_deviation": float(known.std()),
            "lowest": float(known.min()),
            "highest": float(known.max()),
            "step_s": float(np.median(np.diff(one.time))),
            "between": column.between,
            "error": column.error,
        }
    return found


def input_lines(inputs: Mapping[str, dict]) -> list[str]:
    """The same in words."""
    return [
        f"{column} is an input, {of['name']}: mean {of['mean']:.4g} {of['unit']}, deviation "
        f"{of['standard_deviation']:.3g}, from {of['lowest']:.4g} to {of['highest']:.4g}, every "
        f"{of['step_s']:.3g} s, {BETWEEN[of['between']]}"
        for column, of in inputs.items()
    ]


def check_inputs(series: Sequence[Series], terms: Sequence[Exponents], n_states: int) -> None:
    """Refuse inputs that tell nothing, or that a library divides by where they cross zero.

    series: of all files. terms: exponents of states and inputs. Raises ValueError.
    """
    for k, name in enumerate(series[0].inputs, start=n_states):
        own = [one.inputs[name].values for one in series]
        least, most = (f([f(v[np.isfinite(v)]) for v in own]) for f in (min, max))
        if least == most:
            raise ValueError(
                f"{series[0].path}: input {name} is {least:g} throughout: what never changes "
                "drives nothing that could be told; leave it out"
            )
        divides = any(term[k] < 0 for term in terms)
        if divides and least <= 0.0 <= most:
            raise ValueError(
                f"{series[0].path}: input {name} crosses zero, from {least:g} to {most:g}, and "
                f"the library divides by it; leave out the terms with /{name}"
            )


def held_at(texts: Sequence[str], inputs: Sequence[str]) -> dict[str, float | np.ndarray]:
    """Values of inputs by name, from `U=12`, or `U=8:16` and `U=8:16:0.5`, a range.

    Raises ValueError where a text has another form or names no input.
    """
    found: dict[str, float | np.ndarray] = {}
    for text in texts:
        name, _, said = (part.strip() for part in text.partition("="))
        if name not in inputs:
            has = f"has the inputs {', '.join(inputs)}" if inputs else "has no inputs"
            raise ValueError(f"--at {text}: the model {has}")
        try:
            values = [float(part) for part in said.split(":")]
        except ValueError:
            values = []
        low, high, *step = [*values, *values] if len(values) == 1 else values or [np.nan] * 4
        step = step or [(high - low) / (VALUES - 1)]
        if not (np.isfinite([low, high, *step]).all() and low <= high and len(step) == 1):
            raise ValueError(
                f"--at {text}: must be one value, {name}=12, or a range with or without a step, "
                f"{name}=8:16 or {name}=8:16:0.5"
            )
        count = round((high - low) / step[0]) + 1 if high > low and step[0] > 0 else 1
        if high > low and (step[0] <= 0 or count > MOST_VALUES):
            raise ValueError(f"--at {text}: must be 2 to {MOST_VALUES} values")
        found[name] = low if low == high else low + step[0] * np.arange(count)
    return found


def mean_inputs(model: PolynomialModel, recordings: Sequence[Recording]) -> dict[str, float]:
    """Of the inputs of a model, over the samples of the recordings."""
    return {
        name: float(np.nanmean(np.concatenate([one.inputs[name](one.time) for one in recordings])))
        for name in model.inputs
    }


def known_ahead(
    model: PolynomialModel,
    recording: Recording,
    time: np.ndarray,
    ahead: Mapping[str, Input | float],
) -> Recording:
    """The recording with the inputs of a model known up to the end of `time`, s.

    ahead: by name, what they are after the recording: measured, or a constant. Raises ValueError
    where one is not known.
    """
    inputs = dict(recording.inputs)
    for name in model.inputs:
        if name not in inputs:
            raise ValueError(f"recording: has no input {name}, which drives the model")
        if name in ahead:
            inputs[name] = _continued(name, inputs[name], ahead[name], recording.time[-1], time[-1])
        elif not inputs[name].covered(time).all():
            held = np.nanmean(inputs[name].values)
            raise ValueError(
                f"the model is driven by {name}: say what it is after the recording, in a file "
                f"(--inputs FILE) or held (--at {name}={held:.3g})"
            )
    return replace(recording, inputs=inputs)


def _continued(name: str, past: Input, ahead: Input | float, end: float, until: float) -> Input:
    """An input up to `end`, s, and what it is from then on: its samples are as close as before."""
    kept = past.time <= end
    step = float(np.median(np.diff(past.time)))
    time = np.arange(past.time[kept][-1] + step, until + 2 * step, step)
    if isinstance(ahead, Input):
        values = ahead(time)
        known = np.isfinite(values)
        late = (time < ahead.stretches[0][0]) & (time < end + GAP * step)
        beyond = time > until
        if not known.any() or not np.all(known | late | beyond):
            first, last = ahead.stretches[0][0], ahead.stretches[-1][1]
            raise ValueError(
                f"input {name} is known from {first:g} to {last:g} s after the recording, with "
                f"{len(ahead.stretches) - 1} gaps; it is needed from {end:g} to {until:g} s"
            )
        values = np.interp(time, time[known], values[known])
    else:
        values = np.full(len(time), float(ahead))
    return replace(
        past,
        time=np.append(past.time[kept], time),
        values=np.append(past.values[kept], values),
    )
