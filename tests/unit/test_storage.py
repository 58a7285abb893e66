"""Files are written whole or not at all, with the same bytes for the same content."""

import subprocess
import sys

import numpy as np
import pytest

from galloping.storage import replacing, replacing_folder, write_rows, write_text


def files(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("interruption", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_interrupted_write_leaves_the_old_file_and_no_part(tmp_path, interruption):
    path = tmp_path / "table.csv"
    write_text(path, "old")
    with pytest.raises(interruption), replacing(path) as partial:
        assert partial.parent == path.parent  # a rename within one file system
        partial.write_text("half of the n")
        assert path.read_text() == "old"  # as readers see it
        raise interruption
    assert path.read_text() == "old" and files(tmp_path) == ["table.csv"]


@pytest.mark.parametrize("end", [None, RuntimeError, KeyboardInterrupt, OSError])
@pytest.mark.parametrize("place", ["new", "deep/new", "old", "link", "link/new"])
def test_a_folder_is_written_whole_or_not_at_all(tmp_path, place, end):
    (tmp_path / "old").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "absent")
    (tmp_path / "old" / "a").write_text("old")
    (tmp_path / "old" / "mine").write_text("mine")
    before = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*"))
    try:
        with replacing_folder(tmp_path / place) as folder:
            (folder / "a").write_text("new")
            assert (tmp_path / "old" / "a").read_text() == "old"
            if end:
                raise end
    except (RuntimeError, KeyboardInterrupt, OSError):
        assert sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*")) == before
        assert (tmp_path / "old" / "a").read_text() == "old"
    else:
        assert not end and (tmp_path / place / "a").read_text() == "new"
        assert (tmp_path / "old" / "mine").read_text() == "mine"
        assert files(tmp_path / place) == (["a", "mine"] if place == "old" else ["a"])


WAITING = """
import sys, time
from galloping.storage import replacing_folder
with replacing_folder(sys.argv[1]) as folder:
    (folder / "a").write_text("half")
    print("begun", flush=True)
    time.sleep(60)
"""


def test_what_a_killed_process_left_is_removed_and_what_another_writes_is_not(tmp_path):
    def begun():
        command = [sys.executable, "-c", WAITING, str(tmp_path / "out")]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout.readline() == "begun\n"
        return process

    killed, working = begun(), begun()
    killed.kill()
    killed.wait()
    assert len(files(tmp_path)) == 2
    (tmp_path / ".partial-1-other").mkdir()
    with replacing_folder(tmp_path / "out") as folder:
        mine = folder.name
        assert files(tmp_path) == sorted([".partial-1-other", f".partial-{working.pid}-out", mine])
    working.kill()
    working.wait()
    with replacing_folder(tmp_path / "new"):
        pass
    assert files(tmp_path) == [".partial-1-other", f".partial-{working.pid}-out", "new", "out"]


def test_rows(tmp_path):
    rows = [
        {"name": "a, b", "value": 1 / 3, "count": 2},
        {"name": "c", "value": np.float64("inf"), "count": 3},
        {"name": "d", "value": float("nan"), "count": 4},
        {"name": "e", "value": 1e-20, "count": 5},
    ]
    write_rows(tmp_path / "a.csv", rows)
    assert (tmp_path / "a.csv").read_bytes() == (
        b'name,value,count\n"a, b",0.3333333333,2\nc,inf,3\nd,,4\ne,1e-20,5\n'
    )
