"""The jobs that a study consists of, from Snakemake itself, whether or not they have run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from snakemake.api import SnakemakeApi
from snakemake.settings.enums import Quietness
from snakemake.settings.types import (
    ConfigSettings,
    DAGSettings,
    DeploymentSettings,
    ExecutionSettings,
    OutputSettings,
    ResourceSettings,
    StorageSettings,
    WorkflowSettings,
)
from snakemake_interface_executor_plugins.settings import ExecMode

from galloping.configuration.load import load, plain
from galloping.reproducibility.receipts import Receipt, as_written

SNAKEFILE = Path(__file__).parents[3] / "Snakefile"


@dataclass(frozen=True)
class PlannedJob:
    """One job. settings: as its receipts hold them. Paths are relative to the working folder."""

    rule: str
    wildcards: dict[str, str]
    settings: dict
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    log: str
    benchmark: str

    def made(self, receipt: Receipt | None) -> bool:
        """Whether a receipt is of this very job: settings, code and the inputs by name."""
        if receipt is None:
            return False
        named = (receipt.rule, receipt.wildcards, receipt.settings, receipt.inputs.keys())
        return named == (self.rule, self.wildcards, self.settings, set(self.inputs))

    def unmade(self, path: str) -> Receipt:
        """The receipt of an output of this job that is to be made: without digests."""
        return Receipt(
            path=path,
            rule=self.rule,
            wildcards=self.wildcards,
            log=self.log,
            settings=self.settings,
            inputs=dict.fromkeys(self.inputs, ""),
            sha256="",
            size=0,
            seconds=0.0,
        )


class Plan:
    """All jobs of a study.

    settings: the study's, validated and with defaults. jobs: in no order.
    """

    def __init__(self, workflow):
        self._workflow = workflow
        self._scheduled = {}
        self.settings = plain(load(workflow.globals["config"]))
        self.jobs = []
        for job in workflow.dag.jobs:
            if job.log:  # all but the rule that only collects
                planned = _planned(job)
                self.jobs.append(planned)
                self._scheduled[planned.log] = job

    def begin(self, jobs: Iterable[PlannedJob]) -> None:
        """Let Snakemake's records say that these jobs run now, and what they write is unfinished.

        Until `record` says otherwise: if this process is killed, the next run makes their files.
        """
        for planned in jobs:
            self._workflow.persistence.started(self._scheduled[planned.log])

    def record(self, jobs: Iterable[PlannedJob]) -> None:
        """Let Snakemake's records say that these jobs have run as they are planned now."""
        settings = self._workflow.workflow_settings
        settings.exec_mode = ExecMode.DEFAULT  # the only mode that writes records
        for planned in jobs:
            job = self._scheduled[planned.log]
            self._workflow.async_run(self._workflow.persistence.finished(job))
        settings.exec_mode = ExecMode.SUBPROCESS


@contextmanager
def planning(configfiles: Sequence[str] = ()) -> Iterator[Plan]:
    """The plan of the study in the working folder.

    configfiles: merged over the Snakefile's own, as with Snakemake's --configfile. Raises
    SystemExit with one line for a bad configuration, as Snakemake itself does.
    """
    with SnakemakeApi(OutputSettings(quiet={Quietness.ALL}, enable_file_logging=False)) as api:
        # A subordinate process neither checks earlier results nor asks for lost ones.
        workflow = api.workflow(
            resource_settings=ResourceSettings(cores=1),
            config_settings=ConfigSettings(configfiles=[Path(file) for file in configfiles]),
            storage_settings=StorageSettings(),
            workflow_settings=WorkflowSettings(exec_mode=ExecMode.SUBPROCESS),
            deployment_settings=DeploymentSettings(),
            snakefile=SNAKEFILE,
        )
        workflow.dag(DAGSettings())
        internal = workflow._workflow
        internal.execution_settings = ExecutionSettings()
        internal._prepare_dag(forceall=False, ignore_incomplete=True, lock_warn_only=True)
        internal._build_dag()
        yield Plan(internal)


def _planned(job) -> PlannedJob:
    return PlannedJob(
        rule=job.rule.name,
        wildcards=dict(job.wildcards_dict),
        settings=as_written(job.params.settings),
        inputs=tuple(map(str, job.input)),
        outputs=tuple(map(str, job.output)),
        log=str(job.log[0]),
        benchmark=str(job.benchmark),
    )
