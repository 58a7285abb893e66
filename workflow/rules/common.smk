# The study that the settings describe, and what its rules share.
from functools import cache, partial, reduce
from operator import getitem

from galloping.summary import OUTPUTS, REPORT_OUTPUTS
from galloping.reproducibility import digest
from galloping.reproducibility.lock import RESULTS_VARIABLE
from galloping.report import data_dictionary
from galloping.reproducibility.receipts import RECEIPTS, receipt_path
from galloping.study import shown
from galloping.study.cells import Study, drop_swept_parameters
from galloping.results import MAIN_FAMILY
from galloping.configuration.kinds import PAPER

try:
    files = [read(file) for file in workflow.configfiles]  # the Snakefile's own comes last
    STUDY = Study(load(clean_merged(config, files[-1:] + files[:-1])))
except ConfigurationError as error:
    sys.exit(str(error))
if RESULTS_VARIABLE not in os.environ:  # else `make` has printed them
    print(*STUDY.doubts, sep="\n", end="\n" * bool(STUDY.doubts), file=sys.stderr)

LINES = [case.name for case in STUDY.cases]
FIRST_CASE = LINES[0] if LINES else "none"  # case of figures and tables of one case
CONTINUOUS_CASES = [case.name for case in STUDY.cases if case.is_continuous]
# changes by case; empty without a case of the paper
DEPARTURES = shown.departures_from_paper(STUDY)
# cases with many realisations
REDRAWN_CASES = [name for name, why in DEPARTURES.items() if not why]
# case that is also redrawn with other values of its open parameters
VARIED_CASE = REDRAWN_CASES[0] if REDRAWN_CASES else "none"
DEGREE = STUDY.settings.identification.degree
SEED = STUDY.settings.measurement.seed
# values of parameters that the paper does not state, by name
OPEN_PARAMETERS = STUDY.plain["assessment"]["open_parameters"]
STEADY_WINDOW = list(STUDY.settings.simulation.steady_window)


pathvars:
    results=STUDY.settings.results,
    logs="<results>/logs",
    benchmarks="<results>/benchmarks",


wildcard_constraints:
    case="|".join(LINES) or "none",
    protocol="|".join(protocol.name for protocol in STUDY.protocols),
    cell="|".join(dict.fromkeys(cell.name for cell in STUDY.cells)) or "none",
    family="|".join(dict.fromkeys(method.family for method in STUDY.methods)),
    recording="|".join(STUDY.settings.recordings) or "none",
    sweep="|".join(sweep.name for sweep in STUDY.sweeps) or "none",
    block=r"[a-z_0-9.+-]+",
    trial="|".join(trial.name for trial in STUDY.trials) or "none",
    batch="[a-z_0-9]+",
    parameter="|".join(OPEN_PARAMETERS),


# Params: each is one value under its configuration key. Snakemake compares params without their names,
# so that two swapped numbers would go unnoticed.


def setting(key):
    """What the configuration says at a dotted key."""
    return {key: reduce(getitem, key.split("."), STUDY.plain)}


def line(wildcards):
    """The line of a case, without the states that it is released from."""
    return {f"cases.{wildcards.case}": case(wildcards).line}


def released(wildcards):
    """The line of a case with the state that it is first released from."""
    return {f"cases.{wildcards.case}": case(wildcards).released}


def line_without(case, parameters):
    """A line as released, without its own values of what a sweep varies, which the sweep ignores."""
    return {f"cases.{case}": drop_swept_parameters(STUDY.case(case).released, *parameters)}


def of_sweep(key):
    """What a sweep says at a key."""
    return lambda wildcards: {f"sweeps.{wildcards.sweep}.{key}": getattr(sweep(wildcards), key)}


def amounts():
    """How much the paper's study measures: whole records at all levels, and all subsets."""
    measurement, simulation = STUDY.plain["measurement"], STUDY.plain["simulation"]
    subsets = measurement["subsets"]
    recorded = {key: simulation[key] for key in ("duration", "sampling_rate", "steady_window")}
    measured = {"levels": measurement["levels"], "points": subsets["points"]}
    return {"amounts": {**measured, "subset_level": subsets["level"], **recorded}}


# What the wildcards of a path name: see `galloping.study`.


def case(wildcards):
    return STUDY.case(wildcards.case)


def cell(wildcards):
    return STUDY.cell(wildcards.case, wildcards.protocol, wildcards.cell)


def methods_of(wildcards):
    """The methods of a family that can use the recordings of a cell."""
    return cell(wildcards).families[wildcards.family]


def sweep(wildcards):
    return STUDY.sweep(wildcards.sweep)


def trial(wildcards):
    return STUDY.trial(wildcards.trial)


def batch(wildcards):
    """One case of a trial, and the numbers of the replicates that one job tries."""
    return next(each for each in trial(wildcards).batches if each.name == wildcards.batch)


def recording(wildcards):
    """A section of `recordings`."""
    return STUDY.plain["recordings"][wildcards.recording]


def add_receipts(**files):
    """Outputs of a rule by name, with the receipts that its jobs write beside them."""
    every = [
        file for each in files.values() for file in ([each] if isinstance(each, str) else each)
    ]
    return {**files, RECEIPTS: [str(receipt_path(file)) for file in every]}


# Snakemake's own report (`--report`) has one caption file for a rule: it shows the param `caption` of the
# job. The functions of these params take `output`. Snakemake does not record such params, so that an
# edited caption runs nothing again.
CAPTION = "../report/caption.rst"


def caption_of_figure(name):
    return {"caption": captions("figures", name)}


def table_in_report(name):
    path = f"<results>/tables/{name}.csv"
    return report(path, caption=CAPTION, category="Tables", labels={"table": name})


def captions_of_tables(*names):
    return {"caption": {name: data_dictionary.captions()[name] for name in names}}


# Memory and time requested of schedulers: the maximum in the default study on one core (in the
# comments), and two Snakemakes of 150 MB each. Each further attempt requests as much more.


def resources_by_attempt(mem_mb, runtime):
    """Memory (MB) and time (minutes) of a job."""
    return {
        "mem_mb": lambda wildcards, attempt: mem_mb * attempt,
        "runtime": lambda wildcards, attempt: runtime * attempt,
    }


CASE_RESOURCES = resources_by_attempt(mem_mb=1000, runtime=1)  # 309 MB, 2 s
# 259 MB; 117 s where 1,000 points span 300 s
CELL_RESOURCES = resources_by_attempt(mem_mb=1000, runtime=3)
# 2,100 MB and 4 min for 10^5 s of record
TRIAL_RESOURCES = resources_by_attempt(mem_mb=3000, runtime=15)
SHOW_RESOURCES = resources_by_attempt(mem_mb=600, runtime=2)  # 181 MB, 8 s


# Inputs that depend on the study.


def reference_files(*names):
    """Existing files of the reference; they are never in a storage with the results."""
    folder = Path(STUDY.settings.reference)
    return [local(str(path)) for name in names if (path := folder / name).exists()]


def models_of_a_line(wildcards):
    """Identified models that give the uncertainty of an assessment, if the study has them."""
    cell = shown.assessed_cell(STUDY, wildcards.case)
    return [f"<results>/identified/{cell.id}/{MAIN_FAMILY}.json"] if cell else []


def recorded(wildcards):
    """The cell whose models predict the motion of a case at other wind speeds."""
    return shown.predicted_cells(STUDY, wildcards.case)[wildcards.protocol]


@cache
def code(script, *modules):
    """Digest of the code of a script, and of modules that it imports by name."""
    return digest.code(workflow.source_path(f"../scripts/{script}"), *modules)


def trial_function(wildcards):
    """The function of a trial's kind, as `evaluate.smk` names it."""
    return TRIAL_FUNCTIONS[STUDY.plain["trials"][wildcards.trial]["kind"]]


@cache
def captions(folder, *names):
    """Texts of a folder of `workflow/report`, by name, with the method of the paper's figures."""
    files = {name: workflow.source_path(f"../report/{folder}/{name}.rst") for name in names}
    texts = {name: Path(file).read_text(encoding="utf-8") for name, file in files.items()}
    # read from a git host, files come without their last end of line
    texts = {name: text.rstrip("\n") + "\n" for name, text in texts.items()}
    if not STUDY.cases:
        return texts
    method = shown.paper_method_in_words(STUDY)
    return {name: text.replace("{method}", method) for name, text in texts.items()}
