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
from galloping.figures.registry import BY_NAME as FIGURES
from galloping.reproducibility.digest import code
from galloping.study import jobs
from galloping.study.cells import Study
from galloping.study.paths import CELL
from galloping.tables.registry import BY_NAME as TABLES

try:
    files = [read(file) for file in workflow.configfiles]  # the Snakefile's own comes last
    STUDY = Study(load(merged(config, files[-1:] + files[:-1])))
except ConfigurationError as error:
    sys.exit(str(error))

PATHS = STUDY.paths
RESULTS = STUDY.settings.results


wildcard_constraints:
    case="|".join(case.name for case in STUDY.cases),
    protocol="|".join(protocol.name for protocol in STUDY.protocols),
    cell="|".join(dict.fromkeys(cell.name for cell in STUDY.cells)),
    family="|".join(dict.fromkeys(method.family for method in STUDY.methods)),
    table="|".join(TABLES),
    figure="|".join(FIGURES),


def log_of(path):
    return f"{RESULTS}/logs/{path}.log"


def benchmark_of(path):
    return f"{RESULTS}/benchmarks/{path}.tsv"


def caption(kind):
    """Of a table or a figure. It depends on `output`, so that an edit of it runs nothing again."""

    def text(wildcards, output):
        file = workflow.source_path(f"../report/{kind}s/{wildcards[kind]}.rst")
        return Path(file).read_text(encoding="utf-8")

    return text
