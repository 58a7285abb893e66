"""The command `galloping`: from files to models, from models to motions."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

ERRORS = (ValueError, OSError)


class _OneLine(click.Group):
    """Errors of input end in one line and exit code 1."""

    def invoke(self, context: click.Context) -> object:
        try:
            return super().invoke(context)
        except ERRORS as error:
            raise click.ClickException(str(error)) from error


@click.group(cls=_OneLine, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="galloping")
def main() -> None:
    """Models of galloping lines, and of other polynomial systems, from recordings.

    Shell completion: eval "$(_GALLOPING_COMPLETE=bash_source galloping)"
    """


def _mapping_options(command):
    for option in reversed(
        (
            click.option("--time", "time_column", default="t", help="Column of the times."),
            click.option("--states", help="States, such as x,y,z; each is a column of its name."),
            click.option(
                "--measure", "measures", multiple=True, metavar="STATE=COLUMN[UNIT]@POSITION",
                help="What a column measures: a state, or d and a state for its rate.",
            ),
            click.option(
                "--unit", "units", multiple=True, metavar="COLUMN=UNIT",
                help="Unit of a column; UNIT alone for all but the time.",
            ),
            click.option("--span", type=float, help="m, where columns have positions."),
            click.option("--decimal", default=".", help="Decimal mark of text files."),
            click.option(
                "--map", "map_file", type=click.Path(dir_okay=False),
                help="A YAML file with all of this.",
            ),
        )
    ):  # fmt: skip
        command = option(command)
    return command


def _mapping(time_column, states, measures, units, span, decimal, map_file):
    import yaml

    from galloping.field.mapping import MappingError, channel_of, validated

    if map_file:
        if states or measures:
            raise MappingError("--map stands alone: leave --states and --measure out")
        return validated(yaml.safe_load(Path(map_file).read_text(encoding="utf-8")))
    named = [name.strip() for name in states.split(",")] if states else []
    channels = [channel_of(text) for text in measures]
    if not channels:
        channels = [{"column": name, "measures": name} for name in named]
    if not named:
        raise MappingError("--states: name the states of the system, such as q_v,q_w,dq_v,dq_w")
    by_column = dict(text.partition("=")[::2] for text in units if "=" in text)
    for_all = next((text for text in units if "=" not in text), None)
    for channel in channels:
        unit = by_column.pop(channel["column"], None) or channel.get("unit") or for_all
        if unit:
            channel["unit"] = unit
    time = {"column": time_column, "unit": by_column.pop(time_column, None)}
    if by_column:
        raise MappingError(f"--unit: no column {next(iter(by_column))!r} is measured")
    content = {"time": time, "states": named, "channels": channels, "decimal": decimal}
    return validated({**content, **({"span": span} if span else {})})


@main.command()
@click.argument("files", nargs=-1, required=True)
@_mapping_options
@click.option("--degree", type=click.IntRange(1, 5), default=3, show_default=True)
@click.option("--output", type=click.Path(file_okay=False), required=True, help="Folder to write.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Of the draws of the forecast.")
@click.option("--json", "as_json", is_flag=True, help="Print the result for machines.")
def identify(files, degree, output, seed, as_json, **mapping):
    """Identify one model from FILES, recordings of one system."""
    import numpy as np

    from galloping.field.forecast import forecast
    from galloping.field.study import PERIODS, read_field, tried, write_outputs
    from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
    from galloping.polynomial import library

    field = read_field(files, _mapping(**mapping))
    terms = library(len(field.mapping.states), degree)
    rng = np.random.default_rng(seed)

    def fitted(recordings):
        return maximum_likelihood(recordings, terms)

    with click.progressbar(
        length=4, label="identify", file=sys.stderr, hidden=not sys.stderr.isatty() or as_json
    ) as bar:
        identified = fitted(list(field.recordings))
        bar.update(1)
        trial = ahead = None
        if identified.status != "refused":
            trial = tried(field, fitted, rng)
            bar.update(1)
            last = field.recordings[-1]
            window = PERIODS * field.period
            step = float(np.median(np.diff(last.time)))
            time = last.time[-1] + np.arange(step, window, step)
            ahead = forecast(identified, last, time, window, rng)
            bar.update(1)
        write_outputs(Path(output), field, identified, trial, ahead, ())
        bar.update(1)
    if as_json:
        click.echo(json.dumps({"status": identified.status, "reason": identified.reason,
                               "output": output}))  # fmt: skip
    else:
        click.echo(f"{identified}\nWritten to {output}: begin with summary.md")
    if identified.status == "refused":
        raise SystemExit(3)


@main.command()
@click.argument("file")
@_mapping_options
def inspect(file, **mapping):
    """What a recording is worth: sampling, gaps, noise, spectrum, problems."""
    from galloping.field.study import read_field

    click.echo(json.dumps(read_field([file], _mapping(**mapping)).reports[0], indent=2))


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--latex", is_flag=True, help="Equations as LaTeX.")
def show(model, latex):
    """Print the equations of a MODEL, with errors and verdict."""
    from galloping.identification.model import IdentifiedModel

    loaded = IdentifiedModel.load(model)
    click.echo(loaded.latex() if latex else str(loaded))


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--duration", type=click.FloatRange(0, 1e6, min_open=True), default=300.0)
@click.option("--rate", type=click.FloatRange(0, 1e4, min_open=True), default=25.0, help="Hz.")
@click.option("--initial", help="Initial state, numbers with commas; else that of the recording.")
def simulate(model, duration, rate, initial):
    """Simulate a MODEL and print its states as CSV."""
    import numpy as np

    from galloping.identification.model import IdentifiedModel
    from galloping.simulation import time_grid

    loaded = IdentifiedModel.load(model)
    if initial:
        start = np.array([float(text) for text in initial.split(",")])
    elif len(loaded.initial_states):
        start = loaded.initial_states[0]
    else:
        raise ValueError(f"{model}: holds no initial state; say --initial")
    if len(start) != len(loaded.model.states):
        raise ValueError(f"--initial: {len(start)} numbers for {len(loaded.model.states)} states")
    trajectory = loaded.simulate(start, time_grid(duration, rate))
    click.echo(",".join(["time_s", *loaded.model.states]))
    for time, row in zip(trajectory.time, trajectory.states, strict=True):
        click.echo(",".join(f"{value:.10g}" for value in (time, *row)))
    if trajectory.status != "ok":
        raise ValueError(f"{model}: {trajectory.status}")


@main.command()
@click.argument("case", type=click.Path(dir_okay=False))
def derive(case):
    """Derive the galloping equations of a line from CASE.yaml, a case of the configuration."""
    import yaml

    from galloping.configuration.load import load, plain
    from galloping.physics.equations import model
    from galloping.physics.galerkin import derive as derived

    section = yaml.safe_load(Path(case).read_text(encoding="utf-8")) or {}
    line = derived(plain(load({"cases": {"line": section}}))["cases"]["line"])
    click.echo(json.dumps(line, indent=2))
    equations = model(line["coefficients"])
    for state, row in zip(equations.states, equations.coefficients, strict=True):
        terms = [f"{c:+.6g} {n}" for c, n in zip(row, equations.term_names, strict=True) if c]
        click.echo(f"d({state})/dt = {' '.join(terms)}")
