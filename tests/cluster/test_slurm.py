"""A cell of the smoke study on a SLURM cluster here, with a job cancelled, beside a local run.

The cluster is two nodes on loopback, without systemd, in a folder of its own.
"""

import os
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
import pytest
from studies import copy_repository

pytestmark = pytest.mark.slurm

DAEMONS = ("munged", "slurmctld", "slurmd")
NODES = ("n1", "n2")
PATIENCE = 900.0  # seconds
CELL = "scores/non_resonant/state/noise_0.05.csv"
OPTIONS = (
    *("--workflow-profile", "workflow/profiles/slurm", "--configfile", "config/smoke.yaml"),
    *("--slurm-init-seconds-before-status-checks", "2"),
)
CONFIGURATION = """ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=10
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/%n.spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
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
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[1]} CPUs=1 RealMemory=1000000
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[2]} CPUs=1 RealMemory=1000000
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def until(done, what, seconds=60.0):
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.2)


def daemon(name):
    system = "/usr/local/sbin:/usr/sbin:/sbin"
    return shutil.which(name, path=f"{os.environ.get('PATH', '')}:{system}")


def install():
    """Debian's SLURM and munge, where they are missing."""
    if not all(map(daemon, DAEMONS)):
        if not shutil.which("apt-get") or os.geteuid() != 0:
            pytest.exit("SLURM is missing: install slurm-wlm and munge as root", returncode=1)
        for command in (["update"], ["install", "--no-install-recommends", "slurm-wlm", "munge"]):
            environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
            subprocess.run(["apt-get", "-qy", *command], env=environment, check=True, timeout=600)


@pytest.fixture(scope="module")
def cluster():
    """The environment in which SLURM's commands reach two idle nodes."""
    install()
    folder = Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))  # munge wants a short path
    (folder / "bin").mkdir()
    srun = folder / "bin" / "srun"  # the executor's jobs call it without SLURM_CONF
    srun.write_text(f'#!/bin/sh\nSLURM_CONF={folder}/slurm.conf exec {shutil.which("srun")} "$@"\n')
    srun.chmod(0o755)
    folder.chmod(0o711)  # munged insists
    (folder / "munge.key").touch(mode=0o600)
    (folder / "munge.key").write_bytes(secrets.token_bytes(128))
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(3)]
    ports = [bound.getsockname()[1] for bound in sockets]
    for bound in sockets:
        bound.close()
    host, user = socket.gethostname().split(".")[0], psutil.Process().username()
    text = CONFIGURATION.format(folder=folder, host=host, user=user, ports=ports)
    (folder / "slurm.conf").write_text(text)
    mine = {name: value for name, value in os.environ.items() if not name.startswith("SLURM_")}
    mine |= {"SLURM_CONF": f"{folder}/slurm.conf", "SLURMTEST": str(folder)}
    mine["PATH"] = f"{folder / 'bin'}:{os.environ['PATH']}"
    log = (folder / "daemons.log").open("ab")

    def launch(name, *options):
        command = ["setpriv", "--pdeathsig", "KILL", daemon(name), *options]
        subprocess.Popen(command, env=mine, stdout=log, stderr=log, start_new_session=True)

    keys = [f"--{kind}-file={folder}/munge.{kind}" for kind in ("key", "pid", "log", "seed")]
    try:
        launch("munged", "--foreground", f"--socket={folder}/munge.socket", *keys)
        until((folder / "munge.socket").exists, f"munged: see {folder}")
        launch("slurmctld", "-D")
        for node in NODES:
            launch("slurmd", "-D", "-N", node)
        ready = ("sinfo", "--noheader", "--states=idle", "--format=%D")
        until(lambda: ask(mine, *ready) == "2", f"idle nodes: see {folder}")
        yield mine
    finally:
        log.close()
        while left := [p for p in psutil.process_iter() if marked(p, str(folder))]:
            for process in left:
                process.kill()
            psutil.wait_procs(left, timeout=5)


def marked(process, folder):
    """Whether a process is of this cluster: daemons, jobs and what submits them."""
    try:
        # read here because psutil stops where SLURM's steps have written their title over it
        lines = Path(f"/proc/{process.pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return False
    return f"SLURMTEST={folder}".encode() in lines


def ask(environment, *command):
    """Output of a SLURM command; empty while the controller does not answer."""
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    return run.stdout.strip()


def test_a_cell_on_a_cluster_has_the_bytes_of_a_local_run(root, study, cluster, tmp_path):
    assert study.first.returncode == 0, study.first.stdout
    copy_repository(root, tmp_path)
    command = [sys.executable, "-m", "snakemake", f"results/smoke/{CELL}", *OPTIONS]
    said = (tmp_path / "said.log").open("w")
    run = subprocess.Popen(command, cwd=tmp_path, env=cluster, stdout=said, stderr=said)
    running = ("squeue", "--noheader", "--format=%A", "--states=RUNNING")
    until(lambda: ask(cluster, *running), "a job", PATIENCE)
    ask(cluster, "scancel", ask(cluster, *running).split()[0])
    assert run.wait(PATIENCE) == 0, (tmp_path / "said.log").read_text()
    results = tmp_path / "results/smoke"
    made = [path for path in results.rglob("[!.]*.*") if path.suffix in (".csv", ".npz")]
    assert len(made) > 5
    for path in made:
        assert path.read_bytes() == (study.results / path.relative_to(results)).read_bytes(), path
        assert path.with_name(f".{path.name}.receipt").exists()
    again = subprocess.run(
        [*command, "-n"], cwd=tmp_path, env=cluster, capture_output=True, text=True
    )
    assert "Nothing to be done" in again.stdout + again.stderr
