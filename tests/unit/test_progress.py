"""What a long computation tells while it runs, and the threads that it leaves to others."""

import doctest
import io
import platform
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import galloping
from galloping import progress_reports
from galloping.identification.work import OUTPUT_WORK, count_work, limit_work, sub_budget
from galloping.progress_reports import part, passing, progress
from galloping.summary import terminal

TIME = np.arange(2000) / 20
RECORDING = galloping.Recording(TIME, ("q", "dq"), np.column_stack([np.sin(TIME), np.cos(TIME)]))
TERMS = galloping.polynomial_library(2, 3)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def blas_threads():
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_an_identification_tells_how_far_it_is_and_is_silent_by_default(capfd):
    told = []
    with progress(lambda what, share: told.append((what, share))):
        with part("identify", until=0.5):
            galloping.maximum_likelihood(RECORDING, TERMS)
        passing("done")
    names, shares = zip(*told, strict=True)
    steps = {"identify: smooth the recording", "identify: follow the recording in segments"}
    assert steps <= set(names) and list(shares) == sorted(shares)
    assert shares[0] > 0 and shares[-2] < 0.5 < shares[-1] < 1
    galloping.maximum_likelihood(RECORDING, TERMS)
    assert capfd.readouterr() == ("", "") and len(told) == len(names)
    assert doctest.testmod(progress_reports).failed == 0


def test_parts_take_their_share_also_where_they_fail():
    told = []
    with progress(lambda what, share: told.append((what, round(share, 2)))):
        with part("a", until=0.5), part("b", until=0.5), pytest.raises(ValueError):
            raise ValueError
        passing("c")
    assert told == [("c", 0.52)]


@pytest.fixture
def clock(monkeypatch):
    """A clock that a test sets."""
    now = [100.0]
    monkeypatch.setattr(terminal, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize(("step", "at"), [(0.25, ["2 s", "12 s", "22 s"]), (0.015, [])])
def test_off_a_terminal_there_is_a_line_now_and_then(clock, capsys, step, at):
    with terminal.show_progress():
        for _ in range(100):
            passing("join segments")
            clock[0] += step
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(":")[0] for line in lines] == at
    assert not lines or lines[0] == "2 s: join segments; about 31% done, 5 s left"


def test_a_search_with_a_limit_tells_what_is_left_at_most_once_it_computes(clock, capsys):
    with limit_work([RECORDING], 10.0), sub_budget(0.5), terminal.show_progress():
        for spent, took in ((0.0, 100.0), (0.6, 10.0), (4.0, 10.0), (0.1, 10.0)):
            count_work(spent)
            passing("join segments")
            clock[0] += took
        passing("join segments")
    lines = capsys.readouterr().err.splitlines()
    # 0.6 s counted took 100 s, most of them to compile; then 4 s took 10 s
    most = [2.5 * (10.0 - 4.6 + OUTPUT_WORK), 2.5 * (10.0 - 4.7 + OUTPUT_WORK)]
    assert [line.rpartition(" left")[2] for line in lines] == [
        "", *(f", {each:.0f} s at most" for each in most), f", {most[-1]:.0f} s at most"
    ]  # fmt: skip


def test_on_a_terminal_a_bar_names_what_runs_and_moves(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with terminal.show_progress():
        assert sys.stderr.getvalue() == ""
        for what in ("join segments", "draw limit cycles"):
            passing(what)
            assert what in sys.stderr.getvalue()
    drawn = sys.stderr.getvalue()
    assert "4%" in drawn and "7%" in drawn and drawn.endswith("\n")


def test_linear_algebra_has_one_thread_and_gives_the_others_back():
    seen = []
    with threadpool_limits(2, user_api="blas"), progress(lambda *_: seen.append(blas_threads())):
        before = blas_threads()
        galloping.maximum_likelihood(RECORDING, TERMS)
        assert blas_threads() == before
    assert seen and set.union(*seen) == {1}


MEMORY = """
import resource, numpy as np
from galloping.memory import keep_freed_memory
keep_freed_memory()
for _ in range(50):
    arrays = [np.ones(10**5) for _ in range(20)]
    del arrays
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt * resource.getpagesize())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of another C library")
def test_memory_of_freed_arrays_is_kept():
    """Otherwise the system would clear all memory that was allocated, 16 MB fifty times."""
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, check=True)
    assert int(done.stdout) < 50 * 16e6 / 4
