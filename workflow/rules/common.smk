# Settings, the cells of the study, and the environment of its jobs.
import os
import sys
from pathlib import Path

LIBRARY = Path(workflow.basedir) / "workflow" / "src"
SCRIPTS = Path(workflow.basedir) / "workflow" / "scripts"
sys.path.insert(0, str(LIBRARY))
os.environ["PYTHONPATH"] = str(LIBRARY)
# One thread a job: Snakemake fills the cores, and sums keep their order on any machine.
for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

from galloping.configuration.load import ConfigurationError, load, plain, read
from galloping.identification.registry import BY_NAME
from galloping.reproducibility.digest import code_digest

try:
    for file in workflow.configfiles:
        read(file)  # Snakemake keeps the last of two equal keys in silence
    STUDY = plain(load(config))
except ConfigurationError as error:
    sys.exit(str(error))

RESULTS = STUDY["results"]
CASES = list(STUDY["cases"])
PROTOCOLS = STUDY["measurement"]["protocols"]
METHODS = STUDY["identification"]["methods"]
LEVELS = {f"noise_{level:.12g}": level for level in STUDY["measurement"]["levels"]}
SUBSETS = {f"points_{points}": points for points in STUDY["measurement"]["subsets"]["points"]}


wildcard_constraints:
    case="|".join(CASES),
    protocol="|".join(PROTOCOLS),
    cell="|".join([*LEVELS, *SUBSETS]),
    method="|".join(METHODS),


def out(path):
    """A file of the results folder."""
    return f"{RESULTS}/{path}"


def log_of(path):
    return f"{RESULTS}/logs/{path}.log"


def benchmark_of(path):
    return f"{RESULTS}/benchmarks/{path}.tsv"


def script_code(name, *modules):
    """Digest of the library code behind a script: in `params`, so that an edit reruns the rule."""
    return code_digest(SCRIPTS / name, *modules)


def runs(method, protocol, cell):
    """Whether a method can use the recordings of a cell."""
    described = BY_NAME[method]
    return protocol in described.protocols and not (described.needs_uniform and cell in SUBSETS)


def cells():
    """All (case, protocol, cell, method) of the study."""
    return [
        (case, protocol, cell, method)
        for case in CASES
        for protocol in PROTOCOLS
        for cell in [*LEVELS, *SUBSETS]
        for method in METHODS
        if runs(method, protocol, cell)
    ]


def cell_settings(cell):
    """Noise level and subset size of a cell."""
    if cell in LEVELS:
        return {"level": LEVELS[cell], "points": None}
    return {"level": STUDY["measurement"]["subsets"]["level"], "points": SUBSETS[cell]}
