"""A SLURM cluster of two nodes on this machine, on loopback, without systemd."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import psutil

DAEMONS = ("munged", "slurmctld", "slurmd")
PACKAGES = ("slurm-wlm", "munge")
NODES = ("n1", "n2")
SYSTEM_PATH = "/usr/local/sbin:/usr/sbin:/sbin"
# A variable with the cluster's folder marks all that it starts; jobs drop those that start SLURM_.
CLUSTER = "SLURMTEST"


class ClusterError(RuntimeError):
    """The cluster cannot be installed, started or brought to a state; one line says why."""


def install() -> None:
    """Debian's SLURM and munge, where they are missing."""
    if all(_daemon(name) for name in DAEMONS):
        return
    if not shutil.which("apt-get") or os.geteuid() != 0:
        raise ClusterError(
            f"SLURM is missing: install it as root with `apt-get install {' '.join(PACKAGES)}`"
        )
    for command in (
        ("update", "-q"),
        ("install", "-q", "-y", "--no-install-recommends", *PACKAGES),
    ):
        run = subprocess.run(
            ["apt-get", *command],
            env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=600,
            check=False,
        )
        if run.returncode != 0:
            last = (run.stdout.strip().splitlines() or ["it said nothing"])[-1]
            raise ClusterError(f"apt-get {command[0]} failed: {last}")


class Cluster:
    """munged, slurmctld and one slurmd a node, as this user and in one folder.

    folder: a new one with a short path; configuration, keys, states and logs of the daemons.
    Nothing of the machine's own SLURM or munge is read or written. Raises ClusterError.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith("SLURM_")},
            "SLURM_CONF": str(folder / "slurm.conf"),
            CLUSTER: str(folder),
            "PATH": f"{folder / 'bin'}:{os.environ['PATH']}",
        }
        self._daemons: dict[str, subprocess.Popen] = {}

    def start(self) -> None:
        self._configure()
        socket_file = self.folder / "munge.socket"
        self._launch(
            "munged",
            "--foreground",
            f"--socket={socket_file}",
            *(
                f"--{kind}-file={self.folder}/munge.{kind}"
                for kind in ("key", "pid", "log", "seed")
            ),
        )
        self._until(socket_file.exists, "munged to listen", 20)
        self._launch("slurmctld", "-D")
        for node in NODES:
            self.give_back(node)

    def stop(self) -> None:
        """End every process of the cluster, jobs and what submits them too; its folder stays."""
        _kill(f"{CLUSTER}={self.folder}")
        for daemon in self._daemons.values():
            daemon.wait(timeout=20)
        self._daemons.clear()

    def take_away(self, node: str) -> None:
        """Kill a node with all that runs on it, as a power cut does; SLURM has to notice."""
        _kill(f"{CLUSTER}={self.folder}", f"SLURMD_NODENAME={node}")
        self._daemons.pop(node).wait(timeout=20)
        self._until(lambda: self.state(node).startswith("down"), f"{node} to be down", 60)

    def give_back(self, node: str) -> None:
        """Start a node on a core of its own, if there are so many; it is ready on return."""
        cores = sorted(os.sched_getaffinity(0))
        self._launch(
            *("slurmd", "-D", "-N", node),
            name=node,
            core=cores[NODES.index(node) % len(cores)],
            environment={"SLURMD_NODENAME": node},
        )
        self._until(
            lambda: self.state(node) in ("idle", "mixed", "allocated"), f"{node} to be ready", 60
        )

    def state(self, node: str) -> str:
        return self.query("sinfo", "--noheader", "--nodes", node, "--format", "%T").rstrip("*")

    def jobs(self, *states: str, node: str = "") -> list[str]:
        """Ids of jobs in one of the states, such as RUNNING, or `all`."""
        listed = self.query(
            "squeue", "--noheader", "--format=%A", f"--states={','.join(states)}",
            *((f"--nodelist={node}",) if node else ()),
        )  # fmt: skip
        return listed.split()

    def asked(self, job: str) -> tuple[int, int]:
        """Memory in MB and time in seconds that a job asked for."""
        told = self.query(
            "squeue", "--noheader", "--states=all", f"--jobs={job}", "--format=%m %l", "--noconvert"
        )
        memory, limit = told.split()
        return int(memory.removesuffix("M")), _seconds(limit)

    def query(self, *command: str) -> str:
        """Output of a SLURM command; empty while the controller does not answer."""
        run = subprocess.run(
            command,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            timeout=60,
            check=False,
        )
        return run.stdout.strip()

    def _configure(self) -> None:
        """Write slurm.conf, munge's key, and an srun that finds slurm.conf.

        The executor's jobs call srun without SLURM_CONF, as if it were that of the machine.
        """
        srun = self.folder / "bin" / "srun"
        srun.parent.mkdir()
        srun.write_text(
            f'#!/bin/sh\nSLURM_CONF={self.folder}/slurm.conf exec {shutil.which("srun")} "$@"\n',
            encoding="utf-8",
        )
        srun.chmod(0o755)
        self.folder.chmod(0o711)  # munged insists
        host = socket.gethostname().split(".")[0]
        user = psutil.Process().username()
        controller, *nodes = _free_ports(1 + len(NODES))
        key = self.folder / "munge.key"
        key.touch(mode=0o600)
        key.write_bytes(secrets.token_bytes(128))
        described = "\n".join(
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} "
            "CPUs=1 RealMemory=1000000"
            for node, port in zip(NODES, nodes, strict=True)
        )
        (self.folder / "slurm.conf").write_text(
            f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
# a job of a lost node starts again when its credentials have expired; the default is 120 s
AuthInfo=socket={self.folder}/munge.socket,cred_expire=10
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
StateSaveLocation={self.folder}/state
SlurmdSpoolDir={self.folder}/%n.spool
SlurmctldPidFile={self.folder}/slurmctld.pid
SlurmdPidFile={self.folder}/%n.pid
ProctrackType=proctrack/pgid
KillWait=5
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=1,sched_interval=2,bf_interval=2
SlurmdTimeout=10
ReturnToService=2
{described}
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
""",
            encoding="utf-8",
        )

    def _launch(
        self,
        daemon: str,
        *options: str,
        name: str = "",
        core: int | None = None,
        environment: dict[str, str] | None = None,
    ) -> None:
        """Start a daemon in the foreground, to die with this process."""
        name = name or daemon
        bound = [] if core is None else ["taskset", "--cpu-list", str(core)]
        with (self.folder / f"{name}.log").open("ab") as log:
            self._daemons[name] = subprocess.Popen(
                ["setpriv", "--pdeathsig", "KILL", *bound, _daemon(daemon), *options],
                env={**self.environment, **(environment or {})},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _until(self, done: Callable[[], bool], what: str, seconds: float) -> None:
        end = time.monotonic() + seconds
        while not done():
            for name, daemon in self._daemons.items():
                if daemon.poll() is not None:
                    raise ClusterError(f"{name} ended: see {self.folder / name}.log")
            if time.monotonic() > end:
                raise ClusterError(f"waited {seconds:.0f} s for {what}: see {self.folder}/*.log")
            time.sleep(0.2)


def _daemon(name: str) -> str | None:
    return shutil.which(name, path=f"{os.environ.get('PATH', '')}:{SYSTEM_PATH}")


def _free_ports(number: int) -> list[int]:
    """Ports of loopback that were free a moment ago."""
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(number)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def _marked(*marks: str) -> list[psutil.Process]:
    """Processes with these lines in their environment, the oldest first: daemons before jobs.

    Read here because psutil stops where SLURM's steps have written their title over it.
    """
    wanted = {mark.encode() for mark in marks}
    found = {}
    for process in psutil.process_iter():
        with suppress(OSError, psutil.Error):
            lines = Path(f"/proc/{process.pid}/environ").read_bytes().split(b"\0")
            if wanted <= set(lines):
                found[process] = process.create_time()
    return sorted(found, key=found.get)


def _kill(*marks: str) -> None:
    """Kill the processes with these lines in their environment, and what they start meanwhile."""
    while found := _marked(*marks):
        for process in found:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(found, timeout=5)


def _seconds(limit: str) -> int:
    """Seconds of SLURM's [days-][hours:]minutes:seconds."""
    days, _, clock = limit.rpartition("-")
    total = 0
    for part in clock.split(":"):
        total = 60 * total + int(part)
    return 86400 * int(days or 0) + total
