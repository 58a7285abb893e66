"""Files of a finished study that were truncated, corrupted, edited or deleted."""

import json
import os
import re
from contextlib import contextmanager

import pytest
from commands import JOB_STARTS
from trial import REPAIR, RUN, SMOKE, VERIFY

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

CELL = "non_resonant/state/noise_0.05"


def truncate(path):
    os.truncate(path, path.stat().st_size // 2)


def corrupt(path):
    """Flip bits in the middle; the size stays."""
    content = bytearray(path.read_bytes())
    for k in range(len(content) // 2, len(content) // 2 + 8):
        content[k] ^= 0xFF
    with path.open("r+b") as file:
        file.write(content)


def edit(path):
    with path.open("a") as file:
        file.write("a line of the reader's own\n")


@contextmanager
def times_kept(path):
    state = path.stat()
    yield
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def truncate_with_time_kept(path):
    with times_kept(path):
        truncate(path)


def corrupt_with_times_kept(path):
    with times_kept(path):
        corrupt(path)


DAMAGE = [
    ("an intermediate truncated", f"recordings/{CELL}.npz", truncate),
    ("an intermediate corrupted", f"identified/{CELL}/maximum_likelihood.npz", corrupt),
    (
        "an intermediate truncated, its time kept",
        f"reconstructions/{CELL}.npz",
        truncate_with_time_kept,
    ),
    (
        "an intermediate corrupted, its size and times kept",
        f"identified/{CELL}/stlsq.npz",
        corrupt_with_times_kept,
    ),
    ("a final table edited by hand", "tables/table3_coefficients.csv", edit),
]


@pytest.mark.parametrize(
    ("fault", "name", "harm"),
    [
        pytest.param(*one, id=one[2].__name__, marks=() if one[2] is edit else pytest.mark.faults)
        for one in DAMAGE
    ],
)
def test_damaged(begin, fault, name, harm):
    trial = begin(fault)
    trial.note_finished()
    path = trial.results / name
    harm(path)
    harmed = path.read_bytes()
    trial.note_harmed(path)
    trial.expect(
        trial.run(RUN),
        rf"^{SMOKE}/{name}: edited or damaged since its job wrote it; `{re.escape(REPAIR)}` sets ",
    )
    recovery = trial.recover(REPAIR)
    kept = trial.results / "set_aside" / name
    assert kept.read_bytes() == harmed
    assert f"set aside as {kept.relative_to(trial.folder)}\n" in recovery.said()
    trial.check()


@pytest.mark.faults
def test_damaged_beneath_the_file_system(begin):
    trial = begin("an intermediate corrupted on the disk itself, size and all times kept")
    trial.run(RUN)
    trial.note_finished()
    path = trial.results / f"reduced/{CELL}.npz"
    corrupt_with_times_kept(path)
    # The time of change cannot be set back: let the remembered one be what it is now.
    seen = trial.folder / ".snakemake/digests.json"
    known = json.loads(seen.read_bytes())
    state = path.stat()
    entry = known[str(path.relative_to(trial.folder))]
    entry[:-1] = [state.st_size, state.st_mtime_ns, state.st_ctime_ns, state.st_ino]
    seen.write_text(json.dumps(known))
    trial.note_harmed(path)
    assert trial.run(RUN).wait() == 0  # nothing to be done, and nothing seen
    trial.expect(trial.run(VERIFY), rf"^{SMOKE}/reduced/{CELL}\.npz: not what its job wrote")
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
def test_damaged_while_a_run_goes_on(begin):
    trial = begin("an intermediate corrupted while a run goes on", at=0.5)
    run = trial.start()
    run.until(lambda: JOB_STARTS.search(run.said()))
    path = trial.results / "trajectories/non_resonant.npz"
    corrupt(path)
    run.wait()
    trial.note_finished()
    trial.note_harmed(path)
    trial.expect(run, rf"^The study stopped: .*{SMOKE}/trajectories/non_resonant\.npz is not what ")
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
@pytest.mark.parametrize(
    ("fault", "name"),
    [
        ("an intermediate deleted while the finals exist", f"recordings/{CELL}.npz"),
        ("a final deleted", "figures/figure05.svg"),
    ],
    ids=["intermediate", "final"],
)
def test_deleted(begin, fault, name):
    trial = begin(fault)
    trial.note_finished()
    path = trial.results / name
    trial.note_harmed(path)
    path.unlink()
    trial.expect(trial.run(VERIFY), rf"^{SMOKE}/{name}: was made and is gone")
    trial.recover(RUN)
    trial.check()


@pytest.mark.faults
@pytest.mark.parametrize(
    ("fault", "harm"),
    [
        ("a receipt deleted", lambda path: path.unlink()),
        ("a receipt truncated", truncate),
    ],
    ids=["deleted", "truncated"],
)
def test_receipts(begin, fault, harm):
    trial = begin(fault)
    trial.note_finished()
    path = trial.results / f"reduced/{CELL}.npz"
    trial.note_harmed(path)
    harm(path.with_name(f".{path.name}.receipt"))
    trial.expect(
        trial.run(RUN),
        rf"^{SMOKE}/reduced/{CELL}\.npz: no receipt says how it was made; `{re.escape(REPAIR)}` sets ",
    )
    trial.recover(REPAIR)
    trial.check()
