# The study that the settings describe, and what its rules share.
import os
import sys
from functools import cache
from pathlib import Path

if isinstance(workflow.current_basedir, os.PathLike):  # a clone: its library is beside it
    LIBRARY = str(Path(workflow.current_basedir).parent / "src")
    sys.path.insert(0, LIBRARY)
    inherited = os.getenv("PYTHONPATH")
    os.environ.update(PYTHONPATH=f"{LIBRARY}{os.pathsep}{inherited}" if inherited else LIBRARY)

try:
    from galloping.configuration.load import ConfigurationError, load, merged, read
except ModuleNotFoundError as error:  # a workflow that was read from a host
    sys.exit(f"{error}: install the library of this workflow with pip, or use a clone")
from galloping.field import OUTPUTS
from galloping.figures import registry as figures
from galloping.reproducibility.digest import code
from galloping.study import jobs
from galloping.study.cells import Study
from galloping.study.kinds import OPEN_PARAMETERS
from galloping.study.paths import CELL
from galloping.tables import registry as tables
from galloping.configuration.trials import PAPER

try:
    files = [read(file) for file in workflow.configfiles]  # the Snakefile's own comes last
    STUDY = Study(load(merged(config, files[-1:] + files[:-1])))
except ConfigurationError as error:
    sys.exit(str(error))

PATHS = STUDY.paths
TABLES = [table.name for table in tables.of_study(STUDY)]
FIGURES = [figure.name for figure in figures.of_study(STUDY)]
RESULTS = STUDY.settings.results


wildcard_constraints:
    case="|".join(case.name for case in STUDY.cases) or "none",
    protocol="|".join(protocol.name for protocol in STUDY.protocols),
    cell="|".join(dict.fromkeys(cell.name for cell in STUDY.cells)) or "none",
    family="|".join(dict.fromkeys(method.family for method in STUDY.methods)),
    recording="|".join(STUDY.settings.recordings) or "none",
    sweep="|".join(sweep.name for sweep in STUDY.sweeps) or "none",
    block=r"[a-z_0-9.+-]+",
    trial="|".join(trial.name for trial in STUDY.trials) or "none",
    batch="[a-z_0-9]+",
    parameter="|".join(OPEN_PARAMETERS),
    table="|".join(TABLES) or "none",
    figure="|".join(FIGURES) or "none",


@cache
def job(rule, *wildcards):
    return getattr(jobs, rule)(STUDY, **dict(wildcards))


def inputs(rule):
    """The files that a rule reads, by name."""
    return lambda wildcards: dict(job(rule, *wildcards.items()).inputs)


@cache
def script_code(name, *modules):
    """Digests of what a script runs: in `params`, so that an edit of it reruns the rule."""
    return code(workflow.source_path(f"../scripts/{name}"), *modules)


def settings(rule):
    """The settings that a rule reads, with its code and that of what it imports by name."""

    def plain(wildcards):
        described = job(rule, *wildcards.items())
        return {**described.settings, "code": script_code(f"{rule}.py", *described.modules)}

    return plain


def log_of(path):
    return f"{RESULTS}/logs/{path}.log"


def benchmark_of(path):
    return f"{RESULTS}/benchmarks/{path}.tsv"


@cache
def captions(kind, *names):
    """Captions of `tables` or `figures`, by name; `introduction` is that of the whole report."""
    files = {name: workflow.source_path(f"../report/{kind}/{name}.rst") for name in names}
    texts = {name: Path(file).read_text(encoding="utf-8") for name, file in files.items()}
    # read from a git host, files come without their last end of line
    return {name: text.rstrip("\n") + "\n" for name, text in texts.items()}
