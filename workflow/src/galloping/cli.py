"""Command-line interface `galloping`: models from files, and motions from models."""

import gc
from collections.abc import Iterator
from pathlib import Path

import click

from galloping import __version__
from galloping.command_errors import OneLineErrors
from galloping.memory import keep_freed_memory
from galloping.summary.terminal import json_text, print_rows, show_progress

ROWS_PER_BLOCK = 100_000  # number of rows that are simulated at once
MAX_FORECAST_ROWS = 1_000_000  # largest number of rows of a forecast and of its window
# Number of new objects between two searches for garbage: imports and figures make hundreds of
# thousands of objects and hardly any garbage, and more searches cost `identify` a few percent.
GARBAGE_THRESHOLD = 100_000
EXIT_REFUSED = 3  # exit code if the recordings give no model
MAX_NUMBER = 1e100  # numbers in options are smaller: products of two are finite


class _PositiveNumber(click.FloatRange):
    """Type of an option that is a positive number; click's own accepts NaN and infinity."""

    def convert(self, value, param, ctx):
        number = super().convert(value, param, ctx)
        if not number < MAX_NUMBER:
            self.fail(f"{value}; must be above 0 and below {self.max or MAX_NUMBER:g}", param, ctx)
        return number


POSITIVE_NUMBER = _PositiveNumber(0, min_open=True)


@click.group(cls=OneLineErrors, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="galloping")
def main() -> None:
    """Identify models of galloping overhead lines, and of other oscillators, from recordings.

    Begin with: galloping identify FILE --output DIR

    Exit codes: 0 done, 1 input that cannot be used or output that cannot be written, 2 wrong usage,
    3 the recordings give no model, 130 interrupted.

    \b
    Shell completion: eval "$(_GALLOPING_COMPLETE=bash_source galloping)"
    """  # noqa: D301 (click reads the backspace)
    gc.set_threshold(GARBAGE_THRESHOLD)
    keep_freed_memory()


def _mapping_options(command):
    for option in reversed(
        (
            click.option(
                "--time", "time_column", help="Column of the times; by default found by its name."
            ),
            click.option(
                "--rate", type=_PositiveNumber(0, 1e9, min_open=True),
                help="Samples per second, Hz, of a file without times. Each row is a sample, or "
                "--time names a column with the numbers of the samples.",
            ),
            click.option(
                "--states", help="States of a system other than a span, such as x,y,z. Columns "
                "have these names, or use --measure.",
            ),
            click.option(
                "--measure", "measures", multiple=True, metavar="STATE=COLUMN[UNIT]@POSITION",
                help="What a column measures: 'q_v=mid [mm]' is a vertical displacement, "
                "ddq_w=acc[g] a horizontal acceleration. @150 is a position of 150 m along the "
                "span.",
            ),
            click.option(
                "--unit", "units", multiple=True, metavar="COLUMN=UNIT",
                help="Unit of a column; UNIT alone is that of all columns but time and inputs.",
            ),
            click.option(
                "--noise", "noises", multiple=True, metavar="COLUMN=VALUE[UNIT]",
                help="Known standard deviation of the noise, for maximum_likelihood; by default "
                "estimated.",
            ),
            click.option(
                "--delay", "delays", multiple=True, metavar="COLUMN=SECONDS",
                help="Time by which a column is late.",
            ),
            click.option(
                "--input", "inputs", multiple=True, metavar="NAME=COLUMN[UNIT] +- ERROR %",
                help="A column that drives the motion, such as U or 'U=wind[m/s] +- 2 %'.",
            ),
            click.option(
                "--between", type=click.Choice(["zero", "linear", "cubic"]),
                help="Inputs between their samples: zero (held), linear, or cubic. By default the "
                "recording determines this.",
            ),
            click.option("--span", type=float, help="Length of the span, m, for positions."),
            click.option(
                "--decimal", type=click.Choice([".", ","]),
                help="Decimal mark of text files; by default recognised.",
            ),
            click.option(
                "--map", "map_file", type=click.Path(dir_okay=False),
                help="A YAML file that replaces all of these options.",
            ),
        )
    ):  # fmt: skip
        command = option(command)
    return command


def _make_mapping(file, options):
    """Make the mapping of columns from options; print how columns are read by their names alone."""
    from galloping.readers.mapping import determine_mapping

    mapping, note = determine_mapping(file, options)
    if note:
        click.echo(note, err=True)
    return mapping


at_option = click.option(
    "--at", multiple=True, metavar="INPUT=VALUE", help="Constant value of an input, such as U=12."
)
inputs_option = click.option(
    "--inputs", "inputs_file", type=click.Path(), metavar="FILE", help="A file with the inputs."
)
seed_option = click.option(
    "--seed", type=click.IntRange(0), default=0, help="Seed of the random numbers for intervals."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")


def _load_usable(path):
    """Load the model in a file. Raises ValueError if there is none."""
    from galloping.identification.identified_model import IdentifiedModel

    loaded = IdentifiedModel.load(path)
    if loaded.status == "refused":
        raise ValueError(f"{path}: holds no model; {loaded.verdict}")
    return loaded


def _texts_in(path, key):
    """Return the texts by name, such as units, that the file of a model has under a key.

    Raises ValueError for anything else.
    """
    from galloping.storage import read_json

    texts = read_json(path).get(key, {})
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        wanted = "must be a mapping of names to texts"
        raise ValueError(f"{path}: not an identified model: {key}: {texts!r:.60}: {wanted}")
    return texts


@main.command()
@click.argument("files", nargs=-1, required=True, type=click.Path())
@_mapping_options
@click.option("--degree", type=click.IntRange(1, 5), help="Highest degree of terms; by default 3.")
@click.option(
    "--library", multiple=True, metavar="TERMS",
    help="Candidate terms, such as 'poly(q_v, dq_v; 3) + U*dq_v + |dq_v| dq_v', with functions "
    "sin, cos, exp, sign, abs or bars, and quotients; or 'wind(U)', the quasi-static law.",
)  # fmt: skip
@click.option(
    "--method", type=click.Choice(["maximum_likelihood", "weak_gls"]),
    default="maximum_likelihood", show_default=True,
)  # fmt: skip
@click.option(
    "--known", multiple=True, metavar="EQUATION",
    help="Prior knowledge, in SI units: an equation, such as 'dq_w = -9.2 q_w - 0.03 dq_w'; a "
    "coefficient, such as 'dq_v: U*dq_v = 0.02', and '+- 0.005' for its standard deviation; or "
    "bounds of a coefficient, such as 'dq_v: dq_v < 0'.",
)  # fmt: skip
@click.option("--random-force", "random_force", metavar="COORDINATES",
              help="Coordinates that unmeasured random forces move, such as q_v,q_w, or all. By "
              "default the recording determines this.")  # fmt: skip
@click.option("--output", type=click.Path(file_okay=False), required=True, help="Folder to write.")
@click.option("--replace", is_flag=True, help="Overwrite an earlier model in that folder.")
@seed_option
@json_option
def identify(
    files, degree, library, method, known, random_force, output, replace, seed, as_json, **mapping
):
    """Identify a model from FILES, all recordings of one system.

    Columns named in plain words, such as "time [s]", "vertical [mm]" and "horizontal [mm]", need no
    further option. "galloping inspect FILE" shows how columns are read. With --write-map it also
    writes a mapping, which you can edit and use as --map. The unit of a column follows its name, or
    is in --unit. Times may be dates.

    A state is a quantity for which the model has an equation. The states of a span are q_v and
    q_w, the vertical and the horizontal displacement of its first mode in m, and their rates dq_v
    and dq_w, the velocities in m/s. A channel is a column of FILES that measures a state or the
    rate of a state. A rate is named by d and its state: an accelerometer measures ddq_v, the rate
    of dq_v. Not every state needs a channel.

    Either all files or none are written to the folder of --output; begin with its summary.md.
    --json prints status, reason, findings with their codes, the paths of all files and the units of
    inputs. It also prints all numbers of summary.json with intervals and units, and the
    coefficients with units and errors, as "galloping show --json" does.
    """
    from galloping.storage import read_json, replacing_folder
    from galloping.summary import OUTPUTS
    from galloping.summary.analysis import FieldQuestion, analyse, read_field
    from galloping.summary.csv_rows import model_rows
    from galloping.summary.wording import TECHNICAL_TITLE

    forced = () if random_force is None else tuple(map(str.strip, random_force.split(",")))
    question = FieldQuestion(degree or 3, method, known, seed, library, forced)
    columns = _make_mapping(files[0], mapping)
    if degree and (library or columns.library):
        raise ValueError("--degree: leave it out where a library says the terms")
    question.terms(columns)  # raises for an invalid library before a file is read
    columns.check_random_force(forced, "--random-force")
    earlier = [name for name in OUTPUTS if (Path(output) / name).exists()]
    if earlier and not replace:
        raise ValueError(
            f"{output}: holds an earlier {earlier[0]}; name another folder, or say --replace"
        )
    with replacing_folder(output) as folder, show_progress():
        field = read_field(files, columns)
        identified = analyse(field, question, folder)
    for one in field.series:
        if one.unused:
            click.echo(f"{one.path.name}: {one.unused_note}", err=True)
    if as_json:
        units = dict(field.series[0].units)
        content = {
            "status": identified.status, "reason": identified.reason, "output": output,
            "findings": [each.as_dict() for each in identified.findings],
            "files": {name: str(Path(output) / name) for name in OUTPUTS},
            "inputs": units, "summary": read_json(Path(output) / "summary.json"),
            "coefficients": model_rows(identified, units),
        }  # fmt: skip
        click.echo(json_text(content))
    else:
        text = (Path(output) / "summary.md").read_text(encoding="utf-8").split(TECHNICAL_TITLE)[0]
        click.echo(f"{text}Written to {output}: summary.md also contains the technical part")
    if identified.status == "refused":
        raise SystemExit(EXIT_REFUSED)


@main.command()
@click.argument("file", type=click.Path())
@_mapping_options
@click.option("--write-map", type=click.Path(dir_okay=False),
              help="Write the mapping of the columns to a new YAML file, for --map.")  # fmt: skip
@json_option
def inspect(file, write_map, as_json, **mapping):
    """Show the data quality of a recording: gaps, noise, frequencies.

    Prints how each column is read, the sampling, gaps, noise and frequencies of the motion, and
    unusual samples. It identifies no model.
    """
    from galloping.summary.analysis import read_field
    from galloping.summary.wording import report_text

    if write_map and _write_mapping(file, write_map, mapping):
        return
    mapping = dict.fromkeys(mapping) | {"map_file": write_map} if write_map else mapping
    with show_progress():
        report = read_field([file], _make_mapping(file, mapping)).reports[0]
    click.echo(json_text(report, indent=2) if as_json else report_text(report))


def _write_mapping(file, path, options) -> dict:
    """Write a mapping of a file's columns, and return its uncertain entries by column."""
    from galloping.readers.mapping import MappingError, propose_mapping
    from galloping.storage import write_text

    option_keys = {key for key, value in options.items() if value not in (None, ())}
    if other := option_keys - {"time_column", "rate", "decimal", "units"}:
        parameters = click.get_current_context().command.params
        name = next(each.opts[0] for each in parameters if each.name in other)
        raise MappingError(
            f"--write-map goes with --time, --rate, --unit and --decimal; not {name}"
        )
    if Path(path).exists():
        raise MappingError(f"{path}: exists; name another file, or remove it")
    proposal = propose_mapping(file, options)
    if not proposal.channels:
        proposal.sure_channels(file)  # which says why there is nothing to write
    write_text(Path(path), proposal.yaml(Path(file).name, options["decimal"], options["rate"]))
    click.echo(f"Written {path}: {proposal}", err=True)
    for column, doubt in proposal.doubts.items():
        click.echo(f"Check {column!r} in {path}: {doubt}", err=True)
    return proposal.doubts


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.argument("file", type=click.Path())
@_mapping_options
@click.option("--duration", type=POSITIVE_NUMBER,
              help="Length of the forecast, s; by default that of the window.")  # fmt: skip
@click.option("--window", type=POSITIVE_NUMBER,
              help="Length of the last part of FILE that the forecast starts from, s; by default "
              "six periods.")  # fmt: skip
@at_option
@inputs_option
@seed_option
@json_option
def forecast(model, file, duration, window, at, inputs_file, seed, as_json, **mapping):
    """Use a MODEL to forecast the motion after the recording FILE.

    Uses a MODEL of "galloping identify", and prints CSV with a 90 % band for each channel.

    FILE may be newer than the recordings of the model. Only its end is used. Its columns are read
    as by "galloping identify". A model with inputs needs them after the end, too: they are constant
    (--at U=12), or are in another file with the same columns and clock (--inputs), or in FILE, if
    its inputs continue after the motion.
    """
    import numpy as np

    from galloping.summary.analysis import read_field
    from galloping.summary.csv_rows import forecast_rows
    from galloping.summary.driving import read_later_inputs
    from galloping.summary.summarise import forecast as forecast_from

    loaded = _load_usable(model)
    states = loaded.model.states
    if not mapping["map_file"]:
        mapping["states"] = mapping["states"] or ",".join(states)
        mapping["inputs"] = mapping["inputs"] or loaded.model.inputs
    columns = _make_mapping(file, mapping).with_between(_texts_in(model, "between"))
    field = read_field([file], columns)
    if field.mapping.states != states:
        raise ValueError(
            f"{model}: has the states {', '.join(states)}, not {', '.join(field.mapping.states)}"
        )
    inputs = read_later_inputs(field, loaded.model.inputs, at, inputs_file)
    _warn_of_extrapolation(loaded, inputs)
    recording, time = field.recordings[-1], None
    for option, length in (("--duration", duration), ("--window", window)):
        if length and length / recording.step > MAX_FORECAST_ROWS:
            step = f"{recording.step:g} s, that of {file}"
            raise ValueError(
                f"{option} {length:g}: must be {MAX_FORECAST_ROWS:,} steps of {step}, or less"
            )
    if duration:
        samples = max(duration / recording.step, 2.0)
        time = recording.time[-1] + recording.step * np.arange(1, round(samples) + 1)
    with show_progress():
        ahead = forecast_from(loaded, recording, time, window=window, inputs=inputs, seed=seed)
    print_rows(forecast_rows(ahead), as_json)
    _warn_of_status(loaded)


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--latex", is_flag=True, help="Equations as LaTeX.")
@json_option
def show(model, latex, as_json):
    """Print the equations of a MODEL, with standard errors and status."""
    from galloping.identification.identified_model import IdentifiedModel
    from galloping.summary.csv_rows import model_rows

    if latex and as_json:
        raise click.UsageError("--latex and --json exclude each other")
    loaded = IdentifiedModel.load(model)
    if as_json:
        click.echo(json_text(model_rows(loaded, _texts_in(model, "units"))))
    else:
        click.echo(loaded.latex() if latex else str(loaded))


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option(
    "--duration",
    type=POSITIVE_NUMBER,
    help="Duration, s; by default 60 periods of the slowest mode, at most that of the inputs.",
)
@click.option("--rate", type=POSITIVE_NUMBER,
              help="Samples per second, Hz; by default 60 in a period of the fastest small "
              "motion.")  # fmt: skip
@click.option(
    "--initial", help="Initial state, numbers with commas; by default that of the recording."
)
@at_option
@inputs_option
@click.option("--time", "time_column",
              help="Column of the times in that file; by default found by its name.")  # fmt: skip
@json_option
def simulate(model, duration, rate, initial, at, inputs_file, time_column, as_json):
    """Simulate a MODEL and print its states as CSV.

    The inputs of a model are constant (--at U=12), or are in a file with columns of their names
    (--inputs). The first time of that file is the time of the initial state.
    """
    import numpy as np

    from galloping.summary.driving import choose_sampling, read_model_inputs

    loaded = _load_usable(model)
    kinds, units = _texts_in(model, "between"), _texts_in(model, "units")
    names = loaded.model.inputs
    inputs = read_model_inputs(model, names, at, inputs_file, time_column, kinds, units)
    stretches = [one.stretches for one in inputs.values() if not isinstance(one, float)]
    end = min((each[-1][1] for each in stretches), default=np.inf)
    gap = min((each[0][1] for each in stretches if len(each) > 1), default=np.inf)
    if duration and duration > end:
        raise ValueError(f"--duration {duration:g}: {inputs_file} ends {end:g} s after its begin")
    states = loaded.model.states
    if initial:
        try:
            start = np.array(initial.split(","), float)
        except ValueError:
            start = np.empty(0)
        if len(start) != len(states) or not np.all(np.isfinite(start)):
            wanted = f"must be a number for each of {', '.join(states)}"
            raise ValueError(f"--initial: {initial!r}; {wanted}")
    elif np.isfinite(loaded.initial_states).all() and len(loaded.initial_states):
        start = loaded.initial_states[0]
    else:
        raise ValueError(f"{model}: holds no initial state; say --initial")
    usual_duration, usual_rate = choose_sampling(loaded.model, start, inputs)
    _warn_of_extrapolation(loaded, inputs)
    duration, rate = duration or min(end, usual_duration), rate or usual_rate
    if duration > gap:
        wanted = f"fill it, or say --duration {gap:g} or less"
        raise ValueError(f"{inputs_file}: inputs have a gap after {gap:g} s; {wanted}")
    rows = _simulate_rows(model, loaded.model, start, rate, int(duration * rate + 1e-9), inputs)
    print_rows(rows, as_json)
    _warn_of_status(loaded)


def _warn_of_extrapolation(model, inputs) -> None:
    """Say on standard error which inputs lie outside the recorded range of a model."""
    from galloping.behaviour.assess import list_extrapolations

    values = {name: getattr(one, "values", one) for name, one in inputs.items()}
    for warning in list_extrapolations(model, values):
        click.echo(warning, err=True)


def _warn_of_status(model) -> None:
    if model.status != "ok":
        click.echo(f"Caution: status of the model: {model.verdict}", err=True)


def _simulate_rows(path, model, state, rate: float, last: int, inputs) -> Iterator[dict]:
    """Yield rows 0 to `last` of a motion. Raises ValueError, naming the path, if it ends early."""
    import numpy as np

    from galloping.trajectory.simulation import Simulator, escape_distance

    simulator = Simulator(model.states, model.terms, inputs=model.inputs)
    limit = escape_distance(state)
    names, first = ("time_s", *model.states), 0
    while True:
        end = min(first + ROWS_PER_BLOCK, last)
        times = np.arange(first, end + 1) / rate
        trajectory = simulator(model, state, times, inputs, limit)
        rows = np.column_stack([trajectory.time, trajectory.states])[int(first > 0) :]
        for row in rows[np.isfinite(rows).all(axis=1)].tolist():
            yield dict(zip(names, row, strict=True))
        if trajectory.status != "ok":
            raise ValueError(f"{path}: {trajectory.status}")
        if end == last:
            return
        first, state = end, trajectory.states[-1]


@main.command()
@click.argument("model", type=click.Path(dir_okay=False))
@at_option
@seed_option
@click.option("--figure", type=click.Path(dir_okay=False), metavar="FILE",
              help="Draw limit cycles and onset along the range, as SVG and PNG.")  # fmt: skip
@click.option("--csv", "as_csv", is_flag=True, help="Print a table.")
@json_option
@click.option("--verbose", is_flag=True,
              help="Also print equilibria, damping and unstable limit cycles.")  # fmt: skip
def assess(model, at, seed, figure, as_csv, as_json, verbose):
    """Compute the onset of galloping, equilibria and limit cycles of a MODEL.

    The onset is the value of an input, such as a wind speed, at which small motions about the
    equilibrium begin to grow.

    --at sets the inputs to constant values. If it gives a range of one input, such as U=8:16 or
    U=8:16:0.5, stable and unstable limit cycles are followed along the range, and the onset is
    located. Intervals have 95 %.
    """
    from galloping.behaviour.assess import assess as assessed
    from galloping.behaviour.assessment import assessment_rows
    from galloping.summary.driving import parse_input_values
    from galloping.summary.wording import assessment_text

    if as_csv and as_json:
        raise click.UsageError("--csv and --json exclude each other")
    if figure is not None and Path(figure).suffix not in (".svg", ".png"):
        raise ValueError(f"--figure {figure!r}: must end in .svg or .png; both are written")
    loaded, units = _load_usable(model), _texts_in(model, "units")
    values = parse_input_values(at, loaded.model.inputs)
    has_all_inputs = set(loaded.model.inputs) <= set(values)  # otherwise `assess` names the missing
    if figure and has_all_inputs and all(isinstance(value, float) for value in values.values()):
        raise ValueError("--figure: draws amplitudes over a range of an input, such as --at U=4:16")
    with show_progress():
        assessment = assessed(loaded, values, seed=seed)
    if figure:
        from galloping.figures.style import write_figure
        from galloping.summary.drawing import DPI, FONT_SIZE, draw_assessment  # matplotlib

        svg, png = (Path(figure).with_suffix(form) for form in (".svg", ".png"))
        write_figure(svg, png, lambda: draw_assessment(assessment, units), DPI, FONT_SIZE)
    if as_csv or as_json:
        print_rows(assessment_rows(assessment, units), as_json)
    else:
        is_detailed = verbose or len(assessment.conditions) == 1
        text = assessment_text(assessment, units, is_detailed=is_detailed)
        click.echo(f"{text}\n\nStatus of the model: {loaded.verdict}")


@main.command()
@click.argument("case", type=click.Path(dir_okay=False))
@json_option
def derive(case, as_json):
    """Derive and print the galloping equations of the line in CASE.

    CASE is a YAML file with one case of the configuration; config/README.md has the keys.
    """
    from galloping.configuration.yaml_file import ConfigurationError, read
    from galloping.stages import derive as derived

    content = read(case)
    try:
        model = derived(**{str(section): keys for section, keys in content.items()})
    except ConfigurationError as error:
        lines = str(error).splitlines()
        raise ValueError("\n".join(f"{case}: {line}" for line in lines)) from None
    if as_json:
        rows = {
            state: {n: c for n, c in zip(model.term_names, row.tolist(), strict=True) if c}
            for state, row in zip(model.states, model.coefficients, strict=True)
        }
        click.echo(json_text(rows))
    else:
        click.echo("\n".join(model.equations()))


if __name__ == "__main__":  # python -m galloping.cli
    main(prog_name="galloping")
