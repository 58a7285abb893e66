"""The commands that need a model and no recording: show, simulate, assess, derive."""

from collections.abc import Iterator
from pathlib import Path

import click

from galloping.field.terminal import json_text, print_rows, shown

PIECE = 100_000  # rows of a simulation that are held at a time

at_option = click.option(
    "--at", multiple=True, metavar="INPUT=VALUE", help="What an input is held at, such as U=12."
)
inputs_option = click.option(
    "--inputs", "inputs_file", type=click.Path(), metavar="FILE", help="A file with the inputs."
)
seed_option = click.option(
    "--seed", type=click.IntRange(0), default=0, help="Seed of the draws behind intervals."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for machines.")


def answered(path):
    """The model in a file, where there is one."""
    from galloping.identification.model import IdentifiedModel

    loaded = IdentifiedModel.load(path)
    if loaded.status == "refused":
        raise ValueError(f"{path}: holds no model; {loaded.verdict}")
    return loaded


@click.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--latex", is_flag=True, help="Equations as LaTeX.")
@json_option
def show(model, latex, as_json):
    """Print the equations of a MODEL, with errors and verdict."""
    from galloping.field.analysis import model_rows
    from galloping.identification.model import IdentifiedModel
    from galloping.storage import read_json

    if latex and as_json:
        raise click.UsageError("--latex and --json exclude each other")
    loaded = IdentifiedModel.load(model)
    if as_json:
        click.echo(json_text(model_rows(loaded, read_json(model).get("units", {}))))
    else:
        click.echo(loaded.latex() if latex else str(loaded))


@click.command()
@click.argument("model", type=click.Path(dir_okay=False))
@click.option("--duration", type=click.FloatRange(0, 1e6, min_open=True),
              help="s; 300, or as long as the inputs.")  # fmt: skip
@click.option("--rate", type=click.FloatRange(0, 1e4, min_open=True), default=25.0, help="Hz.")
@click.option("--initial", help="Initial state, numbers with commas; else that of the recording.")
@at_option
@inputs_option
@click.option("--time", "time_column", help="Column of the times in that file; t.")
@json_option
def simulate(model, duration, rate, initial, at, inputs_file, time_column, as_json):
    """Simulate a MODEL and print its states as CSV.

    The inputs of a model are held, --at U=12, or come from a file with columns of their names, the
    first time of which is that of the initial state.
    """
    import numpy as np

    from galloping.field.driving import driving

    loaded = answered(model)
    inputs = driving(model, loaded.model.inputs, at, inputs_file, time_column)
    measured = [one.stretches[-1][1] for one in inputs.values() if not isinstance(one, float)]
    known = min(measured, default=np.inf)
    if duration and duration > known:
        raise ValueError(f"--duration {duration:g}: {inputs_file} ends {known:g} s after its begin")
    duration = duration or min(known, 300.0)
    if initial:
        try:
            start = np.array([float(text) for text in initial.split(",")])
        except ValueError:
            start = np.array([np.nan])
        if not np.all(np.isfinite(start)):
            raise ValueError(f"--initial: {initial!r} is not allowed; must be numbers with commas")
    elif np.isfinite(loaded.initial_states).all() and len(loaded.initial_states):
        start = loaded.initial_states[0]
    else:
        raise ValueError(f"{model}: holds no initial state; say --initial")
    states = loaded.model.states
    if len(start) != len(states):
        raise ValueError(
            f"--initial: {len(start)} numbers for {len(states)} states; must be {', '.join(states)}"
        )
    try:
        rows = _simulated(loaded.model, start, rate, int(duration * rate + 1e-9), inputs)
        print_rows(rows, as_json)
    except FloatingPointError as error:
        raise ValueError(f"{model}: {error}") from None


def _simulated(model, state, rate: float, last: int, inputs) -> Iterator[dict]:
    """Rows 0 to `last` of a motion. Raises FloatingPointError where it ends early."""
    import numpy as np

    from galloping.simulation import Simulator

    simulator = Simulator(model.states, model.terms, inputs=model.inputs)
    names, first = ("time_s", *model.states), 0
    while True:
        until = min(first + PIECE, last)
        trajectory = simulator(model, state, np.arange(first, until + 1) / rate, inputs)
        rows = np.column_stack([trajectory.time, trajectory.states])[int(first > 0) :]
        for row in rows[np.isfinite(rows).all(axis=1)].tolist():
            yield dict(zip(names, row, strict=True))
        if trajectory.status != "ok":
            raise FloatingPointError(trajectory.status)
        if until == last:
            return
        first, state = until, trajectory.states[-1]


@click.command()
@click.argument("model", type=click.Path(dir_okay=False))
@at_option
@seed_option
@click.option("--figure", type=click.Path(dir_okay=False), metavar="FILE",
              help="Draw limit cycles and onset along the range, as SVG and PNG.")  # fmt: skip
@click.option("--csv", "as_csv", is_flag=True, help="Print a table.")
@json_option
def assess(model, at, seed, figure, as_csv, as_json):
    """Tell from which wind on a line gallops, how far.

    From a MODEL: positions of rest and their stability, limit cycles, and the onset.

    Inputs are held at what --at says. Along a range of one, such as U=8:16 or U=8:16:0.5, limit
    cycles are followed, the unstable ones as well, and the onset is looked for: where small motions
    about rest begin to grow. Intervals are of 95 %.
    """
    from galloping.field.assess import assess as assessed
    from galloping.field.assess import assessment_rows
    from galloping.field.driving import held_at
    from galloping.field.wording import assessment_text
    from galloping.storage import read_json

    if as_csv and as_json:
        raise click.UsageError("--csv and --json exclude each other")
    loaded, units = answered(model), read_json(model).get("units", {})
    values = held_at(at, loaded.model.inputs)
    if missing := [name for name in loaded.model.inputs if name not in values]:
        name = missing[0]
        raise ValueError(f"{model}: has the input {name}; say at which, --at {name}=VALUE")
    with shown():
        found = assessed(loaded, values, seed=seed)
    if figure:
        from galloping.field.drawing import DPI, FONT_SIZE, draw_assessment  # matplotlib
        from galloping.figures.style import write_figure

        svg, png = (Path(figure).with_suffix(form) for form in (".svg", ".png"))
        write_figure(svg, png, lambda: draw_assessment(found, units), DPI, FONT_SIZE)
    if as_csv or as_json:
        print_rows(assessment_rows(found, units), as_json)
    else:
        click.echo(f"{loaded.verdict}\n{assessment_text(found, units)}")


@click.command()
@click.argument("case", type=click.Path(dir_okay=False))
@json_option
def derive(case, as_json):
    """Derive the equations of a line.

    CASE.yaml is a case of the configuration: config/README.md has its keys.
    """
    from galloping.configuration.load import ConfigurationError, read
    from galloping.stages import derive as derived

    content = read(case)
    try:
        model = derived(**{str(section): keys for section, keys in content.items()})
    except ConfigurationError as error:
        lines = [line.removeprefix(f"{case}: ") for line in str(error).splitlines()]
        raise ValueError("\n".join(f"{case}: {line}" for line in lines)) from None
    if as_json:
        rows = {
            state: {n: c for n, c in zip(model.term_names, row.tolist(), strict=True) if c}
            for state, row in zip(model.states, model.coefficients, strict=True)
        }
        click.echo(json_text(rows))
    else:
        click.echo("\n".join(model.equations()))
