"""A SLURM cluster of this machine for the tests of this folder, and the table they fill."""

import shutil
import tempfile
from pathlib import Path

import pytest
from slurm import Cluster, ClusterError, install

from galloping.storage import write_rows


def pytest_addoption(parser):
    parser.addoption("--slurm-csv", type=Path, help="where to write what was measured")


@pytest.fixture(scope="session")
def rows(request):
    """What was measured, written at the end if it is asked for and all is well."""
    found = []
    yield found
    target = request.config.getoption("slurm_csv", default=None)
    if target and found and not request.session.testsfailed:
        write_rows(target, found)


@pytest.fixture(scope="session")
def cluster(request):
    """Two nodes, idle. The logs of the daemons are kept if a test fails."""
    folder = Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))  # munge wants a short path
    made = Cluster(folder)
    try:
        install()
        made.start()
        yield made
    except ClusterError as error:
        pytest.exit(str(error), returncode=1)
    finally:
        made.stop()
        if request.session.testsfailed:
            print(f"\nThe logs of SLURM are in {folder}")
        else:
            shutil.rmtree(folder)
