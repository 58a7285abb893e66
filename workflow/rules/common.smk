# Settings, the cells of the study, and the environment of its jobs.
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
    from galloping.configuration.load import ConfigurationError, load, merged, plain, read
except ModuleNotFoundError as error:  # a workflow that was read from a host
    sys.exit(f"{error}: install the library of this workflow with pip, or use a clone")
from galloping.configuration.settings import paper_cases_in
from galloping.identification.registry import BY_NAME
from galloping.reproducibility.digest import code

try:
    files = [read(file) for file in workflow.configfiles]  # the Snakefile's own comes last
    settings = load(merged(config, files[-1:] + files[:-1]))
except ConfigurationError as error:
    sys.exit(str(error))

STUDY = plain(settings)
RESULTS = STUDY["results"]
CASES = list(STUDY["cases"])
PAPER_CASES = paper_cases_in(settings)  # the lines that its claims are about
PROTOCOLS = STUDY["measurement"]["protocols"]
METHODS = STUDY["identification"]["methods"]
BOUND = "bound"  # models drawn at the Cramer-Rao bound, evaluated like those of a method
LEVELS = {f"noise_{level:.12g}": level for level in STUDY["measurement"]["levels"]}
SUBSETS = {f"points_{points}": points for points in STUDY["measurement"]["subsets"]["points"]}
JOINT = {f"joint_{level:.12g}": level for level in STUDY["measurement"]["joint_levels"]}


wildcard_constraints:
    case="|".join(CASES),
    protocol="|".join(PROTOCOLS),
    cell="|".join([*LEVELS, *SUBSETS, *JOINT]),
    method="|".join(METHODS),


def out(path):
    """A file of the results folder."""
    return f"{RESULTS}/{path}"


def log_of(path):
    return f"{RESULTS}/logs/{path}.log"


def benchmark_of(path):
    return f"{RESULTS}/benchmarks/{path}.tsv"


@cache
def script_code(name, *modules):
    """Digests of what a script runs: in `params`, so that an edit of it reruns the rule."""
    return code(workflow.source_path(f"../scripts/{name}"), *modules)


def runs(method, protocol, cell):
    """Whether a method can use the recordings of a cell."""
    described = BY_NAME[method]
    return protocol in described.protocols and not (described.needs_uniform and cell in SUBSETS)


def releases(case):
    """Initial states of the recordings of a case."""
    section = STUDY["cases"][case]
    return [section["initial_state"], *section["releases"].values()]


def line_settings(case):
    """A line in its wind: a case but for the states that it is released from."""
    section = STUDY["cases"][case]
    return {key: section[key] for key in section if key not in ("initial_state", "releases")}


def cells_of(case):
    """The cells of a case: noise levels, subsets, and all its recordings together."""
    return [*LEVELS, *SUBSETS, *(JOINT if len(releases(case)) > 1 else ())]


def cells():
    """All (case, protocol, cell) of the study that a method can use."""
    return [
        (case, protocol, cell)
        for case in CASES
        for protocol in PROTOCOLS
        for cell in cells_of(case)
        if methods_of(protocol, cell)[1:]
    ]


def methods_of(protocol, cell):
    """The bound, and the methods that can use the recordings of a cell."""
    return [BOUND, *(method for method in METHODS if runs(method, protocol, cell))]


def noisy_cells():
    """Those with noise, which have a Cramer-Rao bound."""
    return [one for one in cells() if cell_settings(one[0], one[2])["level"] > 0]


def cell_settings(case, cell):
    """Noise level, subset size and number of recordings of a cell."""
    if cell in SUBSETS:
        level = STUDY["measurement"]["subsets"]["level"]
        return {"level": level, "points": SUBSETS[cell], "releases": 1}
    if cell in JOINT:
        return {"level": JOINT[cell], "points": None, "releases": len(releases(case))}
    return {"level": LEVELS[cell], "points": None, "releases": 1}


def noise_settings(wildcards):
    """A cell and what its noise is drawn from; where it has none, whatever the study draws from."""
    cell = cell_settings(wildcards.case, wildcards.cell)
    measurement = STUDY["measurement"]
    drawn = cell["level"] > 0 or cell["points"] is not None
    scaled = cell["level"] > 0 and wildcards.protocol != "derivative"
    return {
        **cell,
        "relative": scaled and measurement["state_noise"] == "relative",
        "replicates": measurement["replicates"] if drawn else 1,
        "seed": measurement["seed"] if drawn else 0,
    }


def method_settings(wildcards):
    """What one method reads of the settings: editing another's keys reruns nothing here."""
    method = BY_NAME[wildcards.method]
    return {
        **method.settings(STUDY["identification"], STUDY["measurement"]["seed"]),
        "code": script_code("identify_model.py", method.reader, method.function),
    }
