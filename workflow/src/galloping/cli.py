"""The command `galloping`: from files to models, from models to motions."""

import sys
from contextlib import suppress
from pathlib import Path

import click

from galloping.cli_models import (
    answered,
    assess,
    at_option,
    derive,
    inputs_option,
    json_option,
    seed_option,
    show,
    simulate,
)
from galloping.field.terminal import json_text, print_rows, shown

REFUSED, INTERRUPTED = 3, 130  # exit codes: the recordings give no model; Ctrl-C


class _OneLine(click.Group):
    """Errors of input end in one line and exit code 1, interruptions in one line and 130."""

    def invoke(self, context: click.Context) -> object:
        try:
            return super().invoke(context)
        except (KeyboardInterrupt, SystemError) as error:
            if not _interrupted(error):
                raise
            click.echo("Interrupted", err=True)
            context.exit(INTERRUPTED)
        except BrokenPipeError:
            raise  # whoever read the rows has enough of them
        except OSError as error:
            what = error.filename or (error.errno and "standard output")
            if what == "standard output":
                with suppress(OSError):  # else what is left in it fails once more at the end
                    sys.stdout.close()
            said = f"{what}: {error.strerror}" if what else str(error)
            raise click.ClickException(said) from error
        except ValueError as error:
            raise click.ClickException(str(error)) from error


def _interrupted(error: BaseException | None) -> bool:
    """Whether an error is an interruption, or compiled code's account of one."""
    return isinstance(error, KeyboardInterrupt) or (
        error is not None and _interrupted(error.__cause__)
    )


@click.group(cls=_OneLine, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="galloping")
def main() -> None:
    """Models of galloping lines, and of other polynomial systems, from recordings.

    Begin with: galloping identify FILE --output DIR

    Exit codes: 0 done, 1 input that cannot be used or output that cannot be written, 2 wrong usage,
    3 the recordings give no model, 130 interrupted.

    \b
    Shell completion: eval "$(_GALLOPING_COMPLETE=bash_source galloping)"
    """


def _mapping_options(command):
    for option in reversed(
        (
            click.option("--time", "time_column", help="Column of the times; else by its name."),
            click.option(
                "--states", help="Of another system than a span, such as x,y,z; columns have these "
                "names, or say --measure.",
            ),
            click.option(
                "--measure", "measures", multiple=True, metavar="STATE=COLUMN[UNIT]@POSITION",
                help="What a column measures: q_v=mid [mm] a vertical displacement, ddq_w=acc[g] a "
                "horizontal acceleration; at 150 m along the span with @150.",
            ),
            click.option(
                "--unit", "units", multiple=True, metavar="COLUMN=UNIT",
                help="Unit of a column; UNIT alone for all but time and inputs.",
            ),
            click.option(
                "--noise", "noises", multiple=True, metavar="COLUMN=VALUE[UNIT]",
                help="Known standard deviation, for maximum_likelihood; else estimated.",
            ),
            click.option(
                "--input", "inputs", multiple=True, metavar="NAME=COLUMN[UNIT] +- ERROR %",
                help="A column that drives the motion, such as U or 'U=wind[m/s] +- 2 %'.",
            ),
            click.option(
                "--between", type=click.Choice(["zero", "linear", "cubic"]),
                help="What inputs are between samples: held, linear, or smooth; else cubic.",
            ),
            click.option("--span", type=float, help="m, where columns have positions."),
            click.option("--decimal", help="Decimal mark of text files; else told from them."),
            click.option(
                "--map", "map_file", type=click.Path(dir_okay=False),
                help="A YAML file with all of this.",
            ),
        )
    ):  # fmt: skip
        command = option(command)
    return command


def _mapping(
    files, time_column, states, measures, units, noises, inputs, between, span, decimal, map_file
):
    """The mapping that options, or else the names of the first file's columns, tell."""
    from galloping.field.columns import NO_UNIT, states_of
    from galloping.field.mapping import (
        MappingError,
        channel_of,
        input_of,
        read_mapping,
        validated,
    )

    if map_file:
        others = (states, measures, units, noises, inputs, between, span, time_column, decimal)
        if any(other not in (None, ()) for other in others):
            raise MappingError("--map stands alone: leave out all other options of columns")
        return read_mapping(map_file)
    named = [name.strip() for name in states.split(",")] if states else []
    channels = [channel_of(text) for text in measures]
    by_column, for_all = _units(units)
    driving = [input_of(text, between or "cubic") for text in inputs]
    taken = [one["column"] for one in driving]
    found = _proposal(files[0], by_column, for_all, time_column, decimal, taken)
    own = [name for name in named if name in found.columns]
    clock = found.time["column"]
    if found.doubts.get(clock, NO_UNIT) != NO_UNIT:
        raise MappingError(f"{files[0]}: no column is plainly the time, say --time {clock!r} or so")
    if channels:
        named = named or states_of(channel["measures"] for channel in channels)
    elif own and all(name in own or name[1:] in own for name in named):
        channels = [{"column": name, "measures": name} for name in own]
    elif set(named) <= set(states_of(("q_v", "q_w"))):
        channels, named = found.sure(str(files[0])), named or found.states
        click.echo(f"{files[0]}: {found}", err=True)
    else:
        channels = [{"column": name, "measures": name} for name in named]
    if not named:
        raise MappingError("--states: name the states of the system, such as x,y,z")
    if for_all:
        channels = [{"unit": for_all, **channel} for channel in channels]
    time = dict(found.time)
    for key, said, of in (
        ("unit", by_column, [time, *channels, *driving]),
        ("noise", dict(text.partition("=")[::2] for text in noises), channels),
    ):
        for column, value in said.items():
            own = [one for one in of if one["column"] == column]
            if not own:
                raise MappingError(f"--{key}: no column {column!r} is measured")
            for one in own:
                one[key] = value
    content = {"time": time, "states": named, "channels": channels, "inputs": driving}
    return validated(content | {"decimal": decimal, "span": span})


def _units(units):
    """The units of columns, and that of all others but the time, or None."""
    from galloping.field.mapping import MappingError

    for_all, *more = [text for text in units if "=" not in text] or [None]
    if more:
        raise MappingError(f"--unit: {for_all} and {more[0]}; must be one for all, or COLUMN=UNIT")
    return dict(text.partition("=")[::2] for text in units if "=" in text), for_all


def _proposal(file, by_column, for_all, time_column, decimal, taken=()):
    from galloping.field.columns import ROWS, proposal
    from galloping.field.file_table import read_table

    table = read_table(file, decimal, time_column, ROWS)
    return proposal(table, by_column, for_all, time_column, taken)


@main.command()
@click.argument("files", nargs=-1, required=True, type=click.Path())
@_mapping_options
@click.option("--degree", type=click.IntRange(1, 5), help="Highest degree of the terms; else 3.")
@click.option(
    "--library", multiple=True, metavar="TERMS",
    help="Candidate terms, such as 'poly(q_v, dq_v; 3) + U*dq_v', or wind: the quasi-static law.",
)  # fmt: skip
@click.option(
    "--method", type=click.Choice(["maximum_likelihood", "weak_gls"]),
    default="maximum_likelihood", show_default=True,
)  # fmt: skip
@click.option(
    "--known", multiple=True, metavar="EQUATION",
    help="What is known, in SI units: an equation, such as 'dq_w = -9.2 q_w - 0.03 dq_w', or a "
    "coefficient, 'dq_v: U*dq_v = 0.02', with its deviation where it is not sure: '+- 0.005'.",
)  # fmt: skip
@click.option("--random-force", "random_force", metavar="COORDINATES",
              help="Such as q_v,q_w, or all: what unmeasured random forces move; else the motion "
              "tells.")  # fmt: skip
@click.option("--output", type=click.Path(file_okay=False), required=True, help="Folder to write.")
@click.option("--replace", is_flag=True, help="Write over an earlier model in that folder.")
@seed_option
@json_option
def identify(
    files, degree, library, method, known, random_force, output, replace, seed, as_json, **mapping
):
    """Identify one model from FILES, recordings of one system.

    Columns named in plain words, such as "time [s]", "vertical [mm]" and "horizontal [mm]", need no
    further option; "galloping inspect FILE" shows how they are read, and with --write-map writes
    that down, to be edited and given as --map. The unit of a column stands behind its name or in
    --unit; times may be dates.

    A state is a quantity whose rate an equation of the model gives. Those of a span are q_v and
    q_w, the vertical and the horizontal displacement of its first mode in m, and their rates dq_v
    and dq_w, the velocities in m/s. A channel is a column of FILES that measures a state or, named
    by d and the state, its rate: an accelerometer measures ddq_v, the rate of dq_v. Not every state
    needs a channel.

    Everything is written to the folder of --output, or nothing; begin with its summary.md.
    """
    from galloping.field import OUTPUTS
    from galloping.field.analysis import Question, analyse, read_field
    from galloping.field.wording import TECHNICAL
    from galloping.storage import replacing_folder

    forced = () if random_force is None else tuple(map(str.strip, random_force.split(",")))
    question = Question(degree or 3, method, known, seed, library, forced)
    columns = _mapping(files, **mapping)
    if degree and (library or columns.library):
        raise ValueError("--degree: leave it out where a library says the terms")
    question.terms(columns)  # which must make sense before anything is read
    columns.check_forced(forced, "--random-force")
    if not output:
        raise ValueError("--output: names no folder")
    earlier = [name for name in OUTPUTS if (Path(output) / name).exists()]
    if earlier and not replace:
        raise ValueError(
            f"{output}: holds an earlier {earlier[0]}; name another folder, or say --replace"
        )
    with replacing_folder(output) as folder, shown():
        field = read_field(files, columns)
        identified = analyse(field, question, folder)
    for line in field.unused:
        click.echo(line, err=True)
    if as_json:
        result = {"status": identified.status, "reason": identified.reason, "output": output}
        click.echo(json_text(result))
    else:
        told, _, _ = (Path(output) / "summary.md").read_text(encoding="utf-8").partition(TECHNICAL)
        click.echo(f"{told}Written to {output}: summary.md also holds the technical part")
    if identified.status == "refused":
        raise SystemExit(REFUSED)


@main.command()
@click.argument("file", type=click.Path())
@_mapping_options
@click.option("--write-map", type=click.Path(dir_okay=False),
              help="Write how the columns are read to a new YAML file, for --map.")  # fmt: skip
@json_option
def inspect(file, write_map, as_json, **mapping):
    """Tell what a recording is worth.

    Prints how each column is read, sampling, gaps, noise, the frequencies of the motion, and what
    is odd about the samples. Nothing is computed from them yet.
    """
    from galloping.field.analysis import read_field
    from galloping.field.wording import report_lines

    if write_map and not _written_map(file, write_map, mapping):
        return
    mapping |= {"map_file": write_map} if write_map else {}
    with shown():
        report = read_field([file], _mapping([file], **mapping)).reports[0]
    click.echo(json_text(report, indent=2) if as_json else "\n".join(report_lines(report)))


def _written_map(file, path, mapping) -> bool:
    """Write a mapping of a file's columns, and say what it leaves open: False where it does."""
    from galloping.field.mapping import MappingError
    from galloping.storage import write_text

    given = [key for key, value in mapping.items() if value not in (None, ())]
    if more := set(given) - {"time_column", "decimal", "units"}:
        raise MappingError(f"--write-map goes with --time, --unit and --decimal; not {min(more)}")
    if Path(path).exists():
        raise MappingError(f"{path}: exists; name another file, or remove it")
    time, decimal = mapping["time_column"], mapping["decimal"]
    found = _proposal(file, *_units(mapping["units"]), time, decimal)
    if not found.channels:
        found.sure(file)  # which says why there is nothing to write
    write_text(Path(path), found.yaml(Path(file).name, decimal))
    click.echo(f"Written {path}: {found}", err=True)
    for column, doubt in found.doubts.items():
        click.echo(f"Check {column!r} in {path}: {doubt}", err=True)
    mapping |= dict.fromkeys(("time_column", "decimal")) | {"units": ()}
    return not found.doubts


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.argument("file", type=click.Path())
@_mapping_options
@click.option("--duration", type=click.FloatRange(0, 1e4, min_open=True), default=30.0,
              show_default=True, help="Length of the forecast, s.")  # fmt: skip
@click.option("--window", type=click.FloatRange(0, 1e4, min_open=True),
              help="Length of the end of FILE to start from, s; else six periods.")  # fmt: skip
@at_option
@inputs_option
@seed_option
@json_option
def forecast(model, file, duration, window, at, inputs_file, seed, as_json, **mapping):
    """Forecast the motion after the end of FILE.

    By a MODEL; prints CSV with a 90 % band for each channel.

    FILE may be newer than the recordings of the model; only its end is used. Its columns are read
    as those of "galloping identify". The inputs of a model after that are held, --at U=12, or come
    from a file with the same columns on the same clock, or from FILE where it goes on with them.
    """
    import numpy as np

    from galloping.field.analysis import forecast_rows, read_field
    from galloping.field.driving import inputs_after
    from galloping.field.summary import forecast as forecast_from

    loaded = answered(model)
    states = loaded.model.states
    if not mapping["map_file"]:
        mapping["states"] = mapping["states"] or ",".join(states)
        mapping["inputs"] = mapping["inputs"] or loaded.model.inputs
    field = read_field([file], _mapping([file], **mapping))
    if field.mapping.states != states:
        raise ValueError(f"{model}: has the states {', '.join(states)}; --states must be the same")
    inputs = inputs_after(field, loaded.model.inputs, at, inputs_file)
    recording = field.recordings[-1]
    step = float(np.median(np.diff(recording.time)))
    steps = np.arange(1, max(round(duration / step), 1) + 1)
    time = recording.time[-1] + step * steps
    with shown():
        ahead = forecast_from(loaded, recording, time, window=window, inputs=inputs, seed=seed)
    print_rows(forecast_rows(ahead), as_json)


for command in (show, simulate, assess, derive):
    main.add_command(command)
