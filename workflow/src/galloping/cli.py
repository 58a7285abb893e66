"""The command `galloping`: from files to models, from models to motions."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

ERRORS = (ValueError, OSError)
REFUSED = 3  # exit code where the recordings give no model


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

    Exit codes: 0 done, 1 input that cannot be used, 2 wrong usage, 3 the recordings give no model.

    \b
    Shell completion: eval "$(_GALLOPING_COMPLETE=bash_source galloping)"
    """


def _mapping_options(command):
    for option in reversed(
        (
            click.option("--time", "time_column", help="Column of the times; t."),
            click.option("--states", help="States, such as x,y,z; each is a column of its name."),
            click.option(
                "--measure", "measures", multiple=True, metavar="STATE=COLUMN[UNIT]@POSITION",
                help="What a column measures: a state, or d and a state for its rate.",
            ),
            click.option(
                "--unit", "units", multiple=True, metavar="COLUMN=UNIT",
                help="Unit of a column; UNIT alone for all but the time.",
            ),
            click.option(
                "--noise", "noises", multiple=True, metavar="COLUMN=VALUE[UNIT]",
                help="Known standard deviation, for maximum_likelihood; else estimated.",
            ),
            click.option("--span", type=float, help="m, where columns have positions."),
            click.option("--decimal", help="Decimal mark of text files; a point."),
            click.option(
                "--map", "map_file", type=click.Path(dir_okay=False),
                help="A YAML file with all of this.",
            ),
        )
    ):  # fmt: skip
        command = option(command)
    return command


def _mapping(time_column, states, measures, units, noises, span, decimal, map_file):
    from galloping.field.mapping import MappingError, channel_of, read_mapping, validated

    if map_file:
        others = (states, measures, units, noises, span, time_column, decimal)
        if any(other not in (None, ()) for other in others):
            raise MappingError("--map stands alone: leave out all other options of columns")
        return read_mapping(map_file)
    time_column, decimal = time_column or "t", decimal or "."
    named = [name.strip() for name in states.split(",")] if states else []
    channels = [channel_of(text) for text in measures]
    if not channels:
        channels = [{"column": name, "measures": name} for name in named]
    if not named:
        raise MappingError("--states: name the states of the system, such as q_v,q_w,dq_v,dq_w")
    by_column = dict(text.partition("=")[::2] for text in units if "=" in text)
    noise_of = dict(text.partition("=")[::2] for text in noises)
    for_all, *more = [text for text in units if "=" not in text] or [None]
    if more:
        raise MappingError(f"--unit: {for_all} and {more[0]}; must be one for all, or COLUMN=UNIT")
    for channel in channels:
        unit = by_column.pop(channel["column"], None) or channel.get("unit") or for_all
        if unit:
            channel["unit"] = unit
        if channel["column"] in noise_of:
            channel["noise"] = noise_of.pop(channel["column"])
    time = {"column": time_column, "unit": by_column.pop(time_column, None)}
    if by_column:
        raise MappingError(f"--unit: no column {next(iter(by_column))!r} is measured")
    if noise_of:
        raise MappingError(f"--noise: no column {next(iter(noise_of))!r} is measured")
    content = {"time": time, "states": named, "channels": channels, "decimal": decimal}
    return validated({**content, **({} if span is None else {"span": span})})


@main.command()
@click.argument("files", nargs=-1, required=True, type=click.Path())
@_mapping_options
@click.option("--degree", type=click.IntRange(1, 5), default=3, show_default=True)
@click.option(
    "--method", type=click.Choice(["maximum_likelihood", "weak_gls"]),
    default="maximum_likelihood", show_default=True,
)  # fmt: skip
@click.option(
    "--known", multiple=True, metavar="STATE=EXPRESSION",
    help="A known equation, such as 'dq_w=-9.2 q_w - 0.03 dq_w', SI units.",
)  # fmt: skip
@click.option("--output", type=click.Path(file_okay=False), required=True, help="Folder to write.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Of the draws of intervals.")
@click.option("--json", "as_json", is_flag=True, help="Print the result for machines.")
def identify(files, degree, method, known, output, seed, as_json, **mapping):
    """Identify one model from FILES, recordings of one system.

    Everything is written to the folder of --output; begin with its summary.md.
    """
    from galloping.field.study import STEPS, Question, analyse

    question = Question(degree, method, known, seed)
    with click.progressbar(
        length=len(STEPS), file=sys.stderr, hidden=not sys.stderr.isatty() or as_json,
        item_show_func=lambda step: step, show_eta=False,
    ) as bar:  # fmt: skip
        identified = analyse(
            files, _mapping(**mapping), question, Path(output), lambda step: bar.update(1, step)
        )
    if as_json:
        result = {"status": identified.status, "reason": identified.reason, "output": output}
        click.echo(json.dumps(result))
    else:
        click.echo(f"{identified}\nWritten to {output}: begin with summary.md")
    if identified.status == "refused":
        raise SystemExit(REFUSED)


@main.command()
@click.argument("file", type=click.Path())
@_mapping_options
@click.option("--json", "as_json", is_flag=True, help="Print the report for machines.")
def inspect(file, as_json, **mapping):
    """What a recording is worth: sampling, gaps, noise, spectrum, problems."""
    from galloping.field.outputs import report_lines
    from galloping.field.study import read_field

    report = read_field([file], _mapping(**mapping)).reports[0]
    click.echo(json.dumps(report, indent=2) if as_json else "\n".join(report_lines(report)))


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.argument("file", type=click.Path())
@_mapping_options
@click.option("--duration", type=click.FloatRange(0, 1e4, min_open=True), default=30.0, help="s.")
@click.option("--window", type=click.FloatRange(0, 1e4, min_open=True),
              help="s at the end of FILE to start from; else six periods.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, help="Of the draws.")
@click.option("--json", "as_json", is_flag=True, help="Print rows for machines.")
def forecast(model, file, duration, window, seed, as_json, **mapping):
    """Forecast with a MODEL where the recording of FILE goes on: CSV with 90 % bands.

    FILE may be newer than the recordings of the model; only its end is used. Without --states the
    columns are those of the model's states.
    """
    import numpy as np

    from galloping.field.forecast import forecast as forecast_from
    from galloping.field.outputs import forecast_rows
    from galloping.field.study import PERIODS, read_field

    loaded = _answered(model)
    states = loaded.model.states
    if not (mapping["states"] or mapping["map_file"]):
        measured = zip(states, np.isfinite(loaded.sigma[-1]), strict=True)
        columns = {part.partition("=")[0] for part in mapping["measures"]}
        if not columns:
            mapping["measures"] = tuple(f"{name}={name}" for name, seen in measured if seen)
        mapping["states"] = ",".join(states)
    field = read_field([file], _mapping(**mapping))
    if field.mapping.states != states:
        raise ValueError(f"{model}: has the states {', '.join(states)}; --states must be the same")
    recording = field.recordings[0]
    step = float(np.median(np.diff(recording.time)))
    steps = np.arange(1, max(round(duration / step), 1) + 1)
    ahead = forecast_from(
        loaded, recording, recording.time[-1] + step * steps,
        window or PERIODS * field.period, np.random.default_rng(seed),
    )  # fmt: skip
    _print_rows(forecast_rows(ahead), as_json)


def _answered(path):
    """The model in a file, where there is one."""
    from galloping.identification.model import IdentifiedModel

    loaded = IdentifiedModel.load(path)
    if loaded.status == "refused":
        raise ValueError(f"{path}: holds no model; {loaded.verdict}")
    return loaded


def _print_rows(rows: list[dict], as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(rows))
        return
    click.echo(",".join(rows[0]))
    for row in rows:
        click.echo(",".join(f"{value:.10g}" for value in row.values()))


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--latex", is_flag=True, help="Equations as LaTeX.")
@click.option("--json", "as_json", is_flag=True, help="Print the terms for machines.")
def show(model, latex, as_json):
    """Print the equations of a MODEL, with errors and verdict."""
    from galloping.field.outputs import model_rows
    from galloping.identification.model import IdentifiedModel

    loaded = IdentifiedModel.load(model)
    if as_json:
        click.echo(json.dumps(model_rows(loaded)))
    else:
        click.echo(loaded.latex() if latex else str(loaded))


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--duration", type=click.FloatRange(0, 1e6, min_open=True), default=300.0)
@click.option("--rate", type=click.FloatRange(0, 1e4, min_open=True), default=25.0, help="Hz.")
@click.option("--initial", help="Initial state, numbers with commas; else that of the recording.")
@click.option("--json", "as_json", is_flag=True, help="Print rows for machines.")
def simulate(model, duration, rate, initial, as_json):
    """Simulate a MODEL and print its states as CSV."""
    import numpy as np

    from galloping.simulation import time_grid

    loaded = _answered(model)
    if initial:
        try:
            start = np.array([float(text) for text in initial.split(",")])
        except ValueError:
            start = np.array([np.nan])
        if not np.all(np.isfinite(start)):
            raise ValueError(f"--initial: {initial!r} is not allowed; must be numbers with commas")
    elif len(loaded.initial_states):
        start = loaded.initial_states[0]
    else:
        raise ValueError(f"{model}: holds no initial state; say --initial")
    states = loaded.model.states
    if len(start) != len(states):
        raise ValueError(f"--initial: {len(start)} numbers for {len(states)} states")
    trajectory = loaded.simulate(start, time_grid(duration, rate))
    rows = np.column_stack([trajectory.time, trajectory.states]).tolist()
    _print_rows([dict(zip(["time_s", *states], row, strict=True)) for row in rows], as_json)
    if trajectory.status != "ok":
        raise ValueError(f"{model}: {trajectory.status}")


@main.command()
@click.argument("case", type=click.Path(dir_okay=False))
@click.option("--json", "as_json", is_flag=True, help="Print coefficients for machines.")
def derive(case, as_json):
    """Derive the galloping equations of a line from CASE.yaml, a case of the configuration."""
    from galloping.configuration.load import ConfigurationError, read
    from galloping.identification.model import IdentifiedModel
    from galloping.stages import derive as derived

    content = read(case)
    try:
        model = derived(**{str(section): keys for section, keys in content.items()})
    except ConfigurationError as error:
        lines = [line.removeprefix(f"{case}: ") for line in str(error).splitlines()]
        raise ValueError("\n".join(f"{case}: {line}" for line in lines)) from None
    exact = IdentifiedModel(model, "unjudged")
    if as_json:
        rows = {
            state: {n: c for n, c in zip(model.term_names, row.tolist(), strict=True) if c}
            for state, row in zip(model.states, model.coefficients, strict=True)
        }
        click.echo(json.dumps(rows))
    else:
        click.echo("\n".join(exact.equations()))
