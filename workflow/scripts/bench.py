"""Measured speed, as ratios against a peer in the same run: bench.py RESULTS OUTPUT.csv.

RESULTS is a finished default study, for its recordings and the memory of its jobs. The study,
smoke and idle times are of real runs in a temporary copy of the project. `make bench` sets one
thread a process, as in a job.
"""

import csv
import shutil
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import pysindy as ps
from scipy.integrate import solve_ivp

from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.sparse.reduction import reduce
from galloping.identification.sparse.stlsq import normalised
from galloping.physics.equations import model
from galloping.polynomial import PolynomialModel, library
from galloping.recording import Recording, Recordings
from galloping.simulation import Simulator, time_grid
from galloping.storage import read_json, write_rows

ROOT = Path(__file__).parents[2]
CASE = "internal_resonance"


def seconds(work, repeats: int) -> float:
    """Median wall time of `work`."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def row(quantity: str, value: float, unit: str, peer: str = "", ratio: float = np.nan, bar=""):
    print(f"{quantity}: {value:.4g} {unit}" + (f" ({ratio:.4g} x {peer})" if peer else ""))
    return {
        "quantity": quantity,
        "value": value,
        "unit": unit,
        "peer": peer,
        "ratio": ratio,
        "bar": bar,
    }


def simulation(results: Path) -> list[dict]:
    """A re-simulation of an identified model against pysindy's, and integrators compared."""
    line = model(read_json(results / f"models/{CASE}.json")["coefficients"])
    terms = library(len(line.states), 3)
    full = line.on_library(terms)
    with np.load(results / f"trajectories/{CASE}.npz") as file:
        grid, exact = file["time"], file["states"][0]
    simulator = Simulator(full.states, terms)
    ours = seconds(lambda: simulator(full, exact[0], grid), 15)

    sindy = ps.SINDy(
        optimizer=ps.STLSQ(threshold=1e-3), feature_library=ps.PolynomialLibrary(degree=3)
    )
    sindy.fit(exact, t=grid, x_dot=line(exact), feature_names=list(line.states))
    start = time.perf_counter()
    theirs = sindy.simulate(exact[0], grid)
    peer = time.perf_counter() - start
    same = PolynomialModel(full.states, terms, np.asarray(sindy.coefficients()))
    reference = _reference(same, exact[0], grid)
    error = np.abs(simulator(same, exact[0], grid).states - reference).max()
    peer_error = np.abs(theirs - reference).max()

    dop = seconds(lambda: _solve(line, exact[0], grid, "DOP853", 1e-10), 1)
    own = Simulator(line.states, line.terms)
    return [
        row("re-simulation of an identified model, 300 s", ours, "s",
            "pysindy simulate", peer / ours, ">= 1000"),
        row("largest error of that re-simulation", error, "SI",
            "pysindy simulate", peer_error / error, ">= 1"),
        row("simulation of the line, heyoka", seconds(lambda: own(line, exact[0], grid), 15), "s",
            "scipy DOP853 at 1e-10", dop / ours),
        row("compilation of the simulator", seconds(lambda: Simulator(full.states, terms), 3), "s"),
    ]  # fmt: skip


def _solve(line, x0, grid, method, tolerance):
    return solve_ivp(
        lambda _, x: line(x[np.newaxis])[0], (grid[0], grid[-1]), x0,
        method=method, t_eval=grid, rtol=tolerance, atol=tolerance,
    ).y.T  # fmt: skip


def _reference(line, x0, grid):
    """The strictest that scipy allows, in eighth order."""
    return _solve(line, x0, grid, "DOP853", 3e-14)


def identification(results: Path) -> list[dict]:
    """Reduction and stlsq with threshold selection against one plain fit; growth with samples."""
    recordings = Recordings.read(results / f"recordings/{CASE}/derivative/noise_0.05.npz")
    recording = recordings.replicates[0][0]
    terms = library(len(recording.states), 3)

    def fit(one: Recording) -> None:
        normalised(reduce([one], terms), threshold=None, path_length=30)

    def plain(optimizer: ps.STLSQ) -> float:
        sindy = ps.SINDy(optimizer=optimizer, feature_library=ps.PolynomialLibrary(degree=3))
        given = {"t": recording.time, "x_dot": recording.derivatives}
        return seconds(lambda: sindy.fit(recording.values, **given), 7)

    ours = seconds(lambda: fit(recording), 31)
    same = plain(ps.STLSQ(threshold=0.01, normalize_columns=True))
    raw = plain(ps.STLSQ(threshold=0.001))
    rows = [
        row("stlsq with threshold selection, 30,001 x 4", ours, "s",
            "pysindy SINDy.fit of the same method at one threshold", same / ours, ">= 10"),
        row("stlsq with threshold selection, 30,001 x 4", ours, "s",
            "pysindy SINDy.fit on raw columns at one threshold", raw / ours, ">= 10"),
    ]  # fmt: skip
    line = model(read_json(results / f"models/{CASE}.json")["coefficients"])
    simulator = Simulator(line.states, line.terms)
    previous = None
    for n in (10_000, 100_000, 1_000_000):
        grid = time_grid(300.0, n / 300.0)
        states = simulator(line, np.array([0.1, 0.1, 0, 0]), grid).states
        rng = np.random.default_rng(0)
        noisy = line(states) + 0.05 * rng.standard_normal(states.shape)
        recording = Recording(grid, line.states, states, noisy)
        cost = seconds(partial(fit, recording), 3)
        rows.append(
            row(f"the same, {n} x 4", cost, "s", *(
                ("a tenth of the samples", cost / previous, "about 10") if previous else ()
            ))
        )  # fmt: skip
        previous = cost
    return rows


def limit(results: Path) -> list[dict]:
    """Maximum likelihood on every replicate of a cell, all stages, compiled before."""
    recordings = Recordings.read(results / f"recordings/{CASE}/state/noise_0.05.npz")
    terms = library(4, 3)
    maximum_likelihood(list(recordings.replicates[0]), terms)
    times = [
        seconds(partial(maximum_likelihood, list(replicate), terms), 1)
        for replicate in recordings.replicates
    ]
    weak = [
        seconds(partial(weak_gls, list(replicate), terms), 1) for replicate in recordings.replicates
    ]
    ours = float(np.median(times))
    return [
        row("maximum_likelihood on 30,001 x 4 at 0.05, median", ours, "s", bar="<= 1.0"),
        row("weak_gls on the same, median", float(np.median(weak)), "s",
            "maximum_likelihood", ours / float(np.median(weak))),
    ]  # fmt: skip


def memory(results: Path) -> list[dict]:
    """Largest resident set of a job, from Snakemake's benchmark files."""
    largest = 0.0
    for path in (results / "benchmarks").rglob("*.tsv"):
        with path.open() as file:
            for record in csv.DictReader(file, delimiter="\t"):
                largest = max(largest, float(record["max_rss"].replace("-", "0")))
    return [row("memory of the largest job", largest, "MiB", bar="<= 1024")]


def whole_runs() -> list[dict]:
    """Default and smoke study from nothing on two cores, and a repetition with nothing to do."""
    tracked = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout.split("\0")
    with tempfile.TemporaryDirectory() as folder:
        for name in filter(None, tracked):
            target = Path(folder) / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)

        def study(*options: str) -> float:
            snakemake = [sys.executable, "-m", "snakemake", "--quiet", "all", "--cores", "2"]
            start = time.perf_counter()
            subprocess.run([*snakemake, *options], cwd=folder, check=True)
            return time.perf_counter() - start

        smoke = ("--configfile", "config/smoke.yaml")
        return [
            row("smoke study and report, two cores", study(*smoke), "s",
                bar="<= 60"),
            row("default study and report, two cores", study(), "s", bar="<= 480"),
            row("repetition with nothing to do", study(), "s", bar="<= 5"),
        ]  # fmt: skip


def main(results: str, output: str) -> None:
    folder = Path(results)
    rows = (
        simulation(folder) + identification(folder) + limit(folder) + memory(folder) + whole_runs()
    )
    write_rows(output, rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
