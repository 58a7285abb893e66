"""The jobs that a study consists of, from Snakemake's API, whether or not they have run.

This module is an executor plugin of Snakemake's for dry runs, which keeps the jobs that it is given
(https://github.com/snakemake/snakemake-interface-executor-plugins).
"""

import csv
import io
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from snakemake.api import DAGApi, SnakemakeApi
from snakemake.exceptions import WorkflowError
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

from galloping.configuration.load import configured, plain
from galloping.reproducibility.receipts import Receipt

SNAKEFILE = Path(__file__).parents[3] / "Snakefile"
CONFIGURATION = "config/config.yaml"


@dataclass(frozen=True)
class PlannedJob:
    """One job. settings: its params. Paths are relative to the working folder."""

    rule: str
    settings: dict
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def made(self, receipt: Receipt | None) -> bool:
        """Whether a receipt is of this very job: settings, code and the inputs by name."""
        return receipt is not None and (
            (receipt.rule, receipt.settings, receipt.inputs.keys())
            == (self.rule, self.settings, set(self.inputs))
        )


@dataclass(frozen=True)
class Plan:
    """A study as it is configured.

    settings: validated and with defaults. configfiles: as with Snakemake's --configfile.
    """

    settings: dict
    jobs: tuple[PlannedJob, ...]
    configfiles: tuple[str, ...] = ()

    @property
    def results(self) -> str:
        """The folder that the study writes."""
        return self.settings["results"]

    @property
    def maker(self) -> dict[str, PlannedJob]:
        """The job that makes each file."""
        return {path: job for job in self.jobs for path in job.outputs}


def planning(configfiles: Sequence[str] = ()) -> Plan:
    """The plan of the study in the working folder.

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
    settings = plain(configured([CONFIGURATION, *configfiles]))
    return Plan(settings, tuple(Executor.jobs), tuple(configfiles))


def recorded(configfiles: Sequence[str] = ()) -> set[str]:
    """Planned files of which Snakemake knows how they were made.

    It takes other files that are there as up to date, whatever is edited.
    """
    with redirect_stdout(io.StringIO()) as said:
        _with_dag(configfiles, lambda dag: dag.summary())
    lines = said.getvalue().splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("output_file\t"))
    rows = csv.DictReader(lines[start:], delimiter="\t")
    return {row["output_file"] for row in rows if row["log-file(s)"] != "-"}


def record(plan: Plan) -> None:
    """Let Snakemake take all files that are there as made just now, in order, as planned now.

    Its --touch, which records the same of planned files that are not there.
    """
    _with_dag(plan.configfiles, lambda dag: dag.execute_workflow("touch"), force=True)


def unlock(configfiles: Sequence[str] = ()) -> None:
    """Take the lock of a run that was killed, as Snakemake's --unlock does."""
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
            # A job that was killed may have left what it wrote: it is planned like any other.
            act(workflow.dag(DAGSettings(forceall=force, force_incomplete=True)))
        except WorkflowError as error:
            sys.exit(str(error))


# --- the plugin ---

common_settings = CommonSettings(
    non_local_exec=False, dryrun_exec=True, implies_no_shared_fs=False, job_deploy_sources=False
)
NO_LOCK = ExecutionSettings(lock=False)


class Executor(AbstractExecutor):
    """Keeps each job instead of running it."""

    jobs: ClassVar[list[PlannedJob]] = []
    cores = 1

    def run_job(self, job) -> None:
        if job.output:  # all but the rule that only collects
            settings = json.loads(job.properties())["params"]
            inputs, outputs = (tuple(map(str, files)) for files in (job.input, job.output))
            self.jobs.append(PlannedJob(job.name, settings, inputs, outputs))
        submitted = SubmittedJobInfo(job=job)
        self.report_job_submission(submitted)
        self.report_job_success(submitted)

    def _nothing(self, *_) -> None:
        """For what comes of jobs that were run."""

    handle_job_success = handle_job_error = get_exec_mode = cancel = shutdown = _nothing
