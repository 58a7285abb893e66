"""What the faults start from, and the table that they fill."""

import shutil
from pathlib import Path

import pytest
from trial import COLUMNS, Trial, contents, copy, receipts, rewind

from galloping.storage import write_rows


def pytest_addoption(parser):
    parser.addoption("--faults-csv", type=Path, help="where to write a row for each fault")


@pytest.fixture(scope="session")
def rows(request):
    """The table of this session, written at its end if it is asked for."""
    found = []
    yield found
    target = request.config.getoption("faults_csv", default=None)
    if target and found:
        write_rows(target, [dict.fromkeys(COLUMNS, "") | row for row in found])


@pytest.fixture(scope="session")
def sound(study):
    """What counts of the undisturbed study."""
    assert study.first.returncode == 0, study.first.stdout
    return contents(study.folder)


@pytest.fixture(scope="session")
def span(study):
    """Start of the undisturbed study and end of its last job, in seconds since the epoch."""
    ends = [path.stat().st_mtime for path in receipts(study.folder).values()]
    return study.began, min(max(ends), study.began + study.seconds)


@pytest.fixture
def begin(study, sound, span, rows, tmp_path):
    """Begin a trial: with a finished study, or with one as it was after a part of its time.

    The trial ends with the test, and its row is kept whatever comes of it.
    """
    trials = []

    def start(fault, *, at=1.0):
        trial = Trial(fault, tmp_path / "study", sound)
        trials.append(trial)
        rows.append(trial.row)
        copy(study.folder, trial.folder)
        if at == 0:
            shutil.rmtree(trial.results)
            shutil.rmtree(trial.folder / ".snakemake")
        elif at < 1:
            rewind(trial.folder, span[0] + at * (span[1] - span[0]))
        return trial

    yield start
    for trial in trials:
        trial.end()
