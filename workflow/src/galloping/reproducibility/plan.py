"""Jobs of a study, from Snakemake's API, and the announcement of a run.

This module is an executor plugin of Snakemake's for dry runs, which stores the jobs that it
receives (https://github.com/snakemake/snakemake-interface-executor-plugins).
"""

import csv
import io
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from statistics import fmean
from typing import ClassVar

from snakemake.api import DAGApi, SnakemakeApi
from snakemake.exceptions import MissingInputException, WorkflowError
from snakemake.settings.enums import Quietness
from snakemake.settings.types import (
    ConfigSettings,
    DAGSettings,
    ExecutionSettings,
    OutputSettings,
    ResourceSettings,
)
from snakemake_interface_executor_plugins.executors.base import AbstractExecutor, SubmittedJobInfo
from snakemake_interface_executor_plugins.registry import ExecutorPluginRegistry
from snakemake_interface_executor_plugins.settings import CommonSettings

from galloping.configuration.load import load_files, plain
from galloping.fields import list_first
from galloping.reproducibility.receipts import (
    RECEIPT_SUFFIX,
    Receipt,
    as_written,
    is_consistent,
    receipt_path,
)
from galloping.storage import read_json

SNAKEFILE = Path(__file__).parents[3] / "Snakefile"
CONFIGURATION = "config/config.yaml"
JOB_START = 1.5  # s: time that a job takes to start, not included in receipts
MAX_LISTED = 3  # edits and rules that a message lists


@dataclass(frozen=True)
class PlannedJob:
    """Job of the workflow as planned: its rule, settings, input files and output files.

    settings: its params. outputs: without receipts. Paths are relative to the working folder.
    """

    rule: str
    settings: dict
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def has_made(self, receipt: Receipt, receipts: Mapping[str, Receipt]) -> bool:
        """Decide whether this job, as planned, made a file from the present inputs."""
        planned = self.rule, self.settings, set(self.inputs)
        is_planned = (receipt.rule, receipt.settings, receipt.inputs.keys()) == planned
        return is_planned and is_consistent(receipt, receipts)


@dataclass(frozen=True)
class Plan:
    """Plan of a study: all its jobs and its settings.

    settings: validated and with defaults. configfiles: as with Snakemake's --configfile.
    """

    settings: dict
    jobs: tuple[PlannedJob, ...]
    configfiles: tuple[str, ...] = ()

    @property
    def results(self) -> str:
        """Folder into which the study writes its results."""
        return self.settings["results"]

    @cached_property
    def maker(self) -> dict[str, PlannedJob]:
        """Mapping from each output file to the job that makes it."""
        return {path: job for job in self.jobs for path in job.outputs}


def find_current(plan: Plan, receipts: dict[str, Receipt]) -> set[str]:
    """Find files that were made with the inputs and settings of the jobs that are planned now.

    They are the outputs of complete jobs whose receipts, and those of all jobs before them, agree
    with the plan. receipts: by path. A file that was left elsewhere on purpose counts as
    present.
    """
    maker = plan.maker

    @cache
    def is_sound(output: str) -> bool:  # a job, by its first output
        job = maker[output]
        before = {maker[path].outputs[0] for path in job.inputs if path in maker}
        job_receipts = [receipts[path] for path in job.outputs if path in receipts]
        return all(map(is_sound, before)) and all(
            job.has_made(each, receipts) for each in job_receipts
        )

    def is_complete(job: PlannedJob) -> bool:
        return all(
            p in receipts and (Path(p).exists() or not receipts[p].kept) for p in job.outputs
        )

    sound = (job for job in plan.jobs if is_sound(job.outputs[0]) and is_complete(job))
    return {path for job in sound for path in job.outputs}


def make_plan(configfiles: Sequence[str] = ()) -> Plan:
    """Determine all jobs of the study in the working folder with Snakemake, without running them.

    configfiles: merged over the Snakefile's own. A bad configuration ends the process with one
    line, as with Snakemake itself.
    """
    ExecutorPluginRegistry().register_plugin("plan", sys.modules[__name__])
    Executor.jobs.clear()
    _with_dag(
        configfiles,
        lambda dag: dag.execute_workflow("plan", execution_settings=NO_LOCK),
        force=True,
    )
    settings = plain(load_files([CONFIGURATION, *configfiles]))
    return Plan(settings, tuple(Executor.jobs), tuple(configfiles))


def find_recorded(configfiles: Sequence[str] = ()) -> set[str]:
    """Find the planned files for which Snakemake has complete records of how they were made.

    Their receipts are recorded as well. Without complete records it regards the output of a job as
    up to date after any edit.
    """
    with redirect_stdout(io.StringIO()) as output:
        _with_dag(configfiles, lambda dag: dag.summary())
    lines = output.getvalue().splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("output_file\t"))
    rows = csv.DictReader(lines[start:], delimiter="\t")
    known = {row["output_file"] for row in rows if row["log-file(s)"] != "-"}
    return {path for path in known if str(receipt_path(path)) in known}


def record(plan: Plan) -> None:
    """Record in Snakemake, by --touch, that planned files, even missing ones, are up to date."""
    _with_dag(plan.configfiles, lambda dag: dag.execute_workflow("touch"), force=True)


def unlock(configfiles: Sequence[str] = ()) -> None:
    """Remove the lock that a killed Snakemake run left, as `snakemake --unlock` does."""
    _with_dag(configfiles, lambda dag: dag.unlock())


def _with_dag(
    configfiles: Sequence[str], act: Callable[[DAGApi], None], force: bool = False
) -> None:
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL}, enable_file_logging=False)) as api:
        try:
            workflow = api.workflow(
                resource_settings=ResourceSettings(cores=1),
                config_settings=ConfigSettings(configfiles=[Path(file) for file in configfiles]),
                snakefile=SNAKEFILE,
            )
            # Unfinished outputs of a killed job are no error: the job is planned like any other.
            act(workflow.dag(DAGSettings(forceall=force, force_incomplete=True)))
        except WorkflowError as error:
            sys.exit(str(error))
        except MissingInputException as error:
            *_, text = str(error).partition("affected files:")
            missing = sorted(filter(None, map(str.strip, text.splitlines())))
            sys.exit(f"{', '.join(missing)}: not here, and no job makes it")
        except (OSError, ValueError, TypeError, LookupError, AttributeError) as error:
            file = getattr(error, "filename", None)
            if file and ".snakemake" not in Path(str(file)).parts:
                raise  # of another folder, such as Snakemake's cache in an unusable HOME
            cause = f"{type(error).__name__}: {error}".splitlines()[0]
            sys.exit(f"Snakemake cannot work with its records in .snakemake ({cause}): remove them "
                     "and repair the study")  # fmt: skip


def describe_run(plan: Plan, receipts: Mapping[str, Receipt], cores: int | None) -> Iterator[str]:
    """Yield lines of text that announce a run: number of jobs, expected duration, and changes.

    The changes are edits of settings and changed code. receipts: by path. cores: that jobs
    share, None for a cluster.
    """
    current = {path for path in find_current(plan, dict(receipts)) if Path(path).exists()}
    current |= {path for path, receipt in receipts.items() if not receipt.kept}
    jobs = _find_waiting(plan, current)
    if not jobs:
        return
    duration = _expected_duration(plan, jobs, receipts, cores)
    yield f"{len(jobs)} of {len(plan.jobs)} jobs will run, {duration}"
    report = receipts.get(f"{plan.results}/report.html")  # has the settings of the last whole run
    before = report.settings.get("study", {}).get("study") if report else None
    if edits := list(_describe_edits(before or plan.settings, plan.settings)):
        yield f"Edited since they last ran: {list_first(edits, MAX_LISTED)}."
    runs = ((job, receipts[path]) for job in jobs for path in job.outputs if path in receipts)
    codes = {job.rule for job, old in runs if old.settings.get("code") != job.settings.get("code")}
    if codes:
        yield f"The code or a library has changed for: {list_first(sorted(codes), MAX_LISTED)}."


def _find_waiting(plan: Plan, current: set[str]) -> list[PlannedJob]:
    """List the jobs that will run.

    These are the jobs whose outputs are not current, those whose outputs are absent and needed by
    a job that runs, and all that depend on a job that runs.
    """
    absent = {path for path in plan.maker if not Path(path).exists()}
    waiting: dict[str, PlannedJob] = {}  # by first output
    added = [job for job in plan.jobs if not current.issuperset(job.outputs)]
    while added:
        waiting |= {job.outputs[0]: job for job in added}
        made = {path for job in waiting.values() for path in job.outputs}
        needed = {path for job in waiting.values() for path in job.inputs} & absent
        added = [
            job
            for job in plan.jobs
            if job.outputs[0] not in waiting
            and not (made.isdisjoint(job.inputs) and needed.isdisjoint(job.outputs))
        ]
    return list(waiting.values())


def duration_in_words(seconds: float) -> str:
    """Format a duration in seconds as a text in h, min or s, such as `10 min`."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"


def _expected_duration(
    plan: Plan, jobs: list[PlannedJob], receipts: Mapping[str, Receipt], cores: int | None
) -> str:
    """Estimate the duration from earlier ones of the same jobs or rule, or the reference."""
    of_rule: dict[str, list[float]] = {}
    for receipt in receipts.values():
        of_rule.setdefault(receipt.rule, []).append(receipt.seconds)
    earlier = [[receipts[path].seconds for path in job.outputs if path in receipts] for job in jobs]
    times = [
        JOB_START + fmean(seconds or of_rule[job.rule])
        for job, seconds in zip(jobs, earlier, strict=True)
        if seconds or job.rule in of_rule
    ]
    if not times:
        origin = Path(plan.settings.get("reference", ""), "origin.json")
        try:
            minutes = read_json(origin)["core_minutes"]
        except (OSError, ValueError, TypeError, LookupError):
            minutes = None
        if type(minutes) not in (int, float):
            return "for the first time: how long is not known yet"
        took = duration_in_words(60 * minutes)
        return f"for the first time: the reference took {took} on one core"
    least = "at least " if len(times) < len(jobs) else ""
    if cores is None:
        return f"{least}about {duration_in_words(sum(times))} of work"
    share = max(sum(times) / cores, max(times))
    return f"{least}about {duration_in_words(share)} on {cores} core{'s' if cores > 1 else ''}"


def _describe_edits(before: object, now: object, key: str = "") -> Iterator[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        for name in [*before, *(name for name in now if name not in before)]:
            below = f"{key}.{name}" if key else str(name)
            if name not in now or name not in before:
                yield f"{below} {'added' if name in now else 'removed'}"
            else:
                yield from _describe_edits(before[name], now[name], below)
    elif before != now:
        yield f"{key} from {before} to {now}"


# --- the plugin ---

common_settings = CommonSettings(
    non_local_exec=False, dryrun_exec=True, implies_no_shared_fs=False, job_deploy_sources=False
)
NO_LOCK = ExecutionSettings(lock=False)


class Executor(AbstractExecutor):
    """Snakemake executor that stores the planned jobs instead of running them."""

    jobs: ClassVar[list[PlannedJob]] = []
    cores = 1

    def run_job(self, job) -> None:
        """Store a job in the plan, and report it to Snakemake as done."""
        if job.output:  # not the rule `all`
            settings = as_written(json.loads(job.properties())["params"])
            outputs = tuple(str(path) for path in job.output if not path.endswith(RECEIPT_SUFFIX))
            self.jobs.append(PlannedJob(job.name, settings, tuple(map(str, job.input)), outputs))
        submitted = SubmittedJobInfo(job=job)
        self.report_job_submission(submitted)
        self.report_job_success(submitted)

    def _do_nothing(self, *_) -> None:
        """Ignore results of jobs that were run."""

    handle_job_success = handle_job_error = get_exec_mode = cancel = shutdown = _do_nothing
