"""Measured speed, as ratios to a peer in the same run: bench.py RESULTS OUTPUT.csv [OLDER].

RESULTS is a finished default study, for its motions and the run time of its jobs. OLDER is the
results folder of the same study by an older version, run on the same machine, whose job seconds are
listed for comparison. The study, smoke and idle times are of real runs in a temporary copy of the
project. `make bench` sets one thread per process, as in a job, except where the default is
measured.
"""

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import timeit
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pysindy as ps
import yaml
from scipy.integrate import solve_ivp

from galloping.configuration.load import load
from galloping.evaluation.bounds import sensitivities
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.sparse.evidence import reduce
from galloping.identification.sparse.stlsq import fit_normalised
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.recording.measurement import recordings_of
from galloping.recording.samples import Recording
from galloping.storage import write_rows
from galloping.study.cells import Study
from galloping.study.files import read_model, read_trajectories
from galloping.trajectory.simulation import Simulator

ROOT = Path(__file__).parents[2]
CASE = "internal_resonance"
N_LEVELS = 310  # noise levels of a study with 5,000 jobs


def time_calls(work: Callable, repeats: int) -> float:
    """Measure the median wall time of several calls of a function, s."""
    return float(np.median(timeit.repeat(work, number=1, repeat=repeats)))


def report(quantity: str, value: float, unit: str, peer: str = "", ratio: float = np.nan, bar=""):
    """Print a measured speed or memory, and return it as a row of the table of results."""
    print(f"{quantity}: {value:.4g} {unit}" + (f" ({ratio:.4g} x {peer})" if peer else ""))
    cells = (quantity, value, unit, peer, ratio, bar)
    return dict(zip(("quantity", "value", "unit", "peer", "ratio", "bar"), cells, strict=True))


def compare_simulation(results: Path) -> list[dict]:
    """Compare time and error of simulating an identified model with those of pysindy."""
    line = read_model(results / f"models/{CASE}.json").model
    motion = read_trajectories(results / f"trajectories/{CASE}.npz")[0]
    grid, exact, terms = motion.time, motion.states, polynomial_library(len(line.states), 3)
    sindy = ps.SINDy(
        optimizer=ps.STLSQ(threshold=1e-3), feature_library=ps.PolynomialLibrary(degree=3)
    )
    sindy.fit(exact, t=grid, x_dot=line(exact), feature_names=list(line.states))
    same = PolynomialModel(line.states, terms, np.asarray(sindy.coefficients()))
    simulator = Simulator(line.states, terms)
    ours = time_calls(lambda: simulator(same, exact[0], grid), 15)
    start = time.perf_counter()
    theirs = sindy.simulate(exact[0], grid)
    peer = time.perf_counter() - start
    strict = solve_ivp(
        lambda _, x: same(x[np.newaxis])[0], (grid[0], grid[-1]), exact[0],
        method="DOP853", t_eval=grid, rtol=3e-14, atol=3e-14,  # the strictest that scipy allows
    ).y.T  # fmt: skip
    error, peers = (
        np.abs(states - strict).max() for states in (simulator(same, exact[0], grid).states, theirs)
    )
    return [
        report("re-simulation of an identified model, 300 s", ours, "s",
            "pysindy simulate", peer / ours, ">= 1000"),
        report("largest error of that re-simulation", error, "SI",
            "pysindy simulate", peers / error, ">= 1"),
    ]  # fmt: skip


def time_integration(results: Path) -> list[dict]:
    """Time the default line's simulation and sensitivities, also with heyoka if installed."""
    line = read_model(results / f"models/{CASE}.json").model
    motion = read_trajectories(results / f"trajectories/{CASE}.npz")[0]
    time, start, free = motion.time, motion.states[0], np.argwhere(line.support)
    works = {
        "simulation of the default line, 300 s": partial(
            Simulator(line.states, line.terms), line, start, time
        ),
        "its derivatives by coefficients and start": partial(
            sensitivities, line, free, start, time
        ),
    }
    peers = heyoka_peers(line, free, start, time) if find_spec("heyoka") else [None] * len(works)
    rows = []
    for (what, ours), theirs in zip(works.items(), peers, strict=True):
        ours()  # compiled before
        our_time = time_calls(ours, 15)
        peer = {"peer": "heyoka", "ratio": time_calls(theirs, 15) / our_time} if theirs else {}
        rows.append(report(what, our_time, "s", bar=">= 0.5", **peer))
    return rows


def heyoka_peers(
    line: PolynomialModel, free: np.ndarray, start: np.ndarray, time: np.ndarray
) -> Iterator[Callable]:
    """Yield the functions of heyoka that compute the same as those of `time_integration`."""
    import heyoka as hy

    x, values = hy.make_vars(*line.states), [hy.par[k] for k in range(len(free))]
    rates = [hy.expression(0.0)] * len(x)
    for (equation, term), value in zip(free, values, strict=True):
        rates[equation] += np.prod(np.repeat(x, line.terms[term]), initial=value)
    states = list(zip(x, rates, strict=True))
    moved = np.append(start, np.eye(len(x), len(free) + len(x), len(free)))
    for system, first in ((states, start), (hy.var_ode_sys(states, [*values, *x]), moved)):
        integrator = hy.taylor_adaptive(
            system, first, pars=line.coefficients[tuple(free.T)], compact_mode=True
        )

        def propagated(integrator=integrator, first=first) -> None:
            integrator.time, integrator.state[:] = time[0], first
            integrator.propagate_grid(time)

        yield propagated


def time_selection(results: Path) -> list[dict]:
    """Compare the time of STLSQ with threshold selection with that of a single pysindy fit."""
    recording = simulate_recordings(results, "derivative")[0][0]
    terms = polynomial_library(len(recording.states), 3)
    sindy = ps.SINDy(
        optimizer=ps.STLSQ(threshold=0.01, normalize_columns=True),
        feature_library=ps.PolynomialLibrary(degree=3),
    )
    given = {"t": recording.time, "x_dot": recording.rates}
    peer = time_calls(lambda: sindy.fit(recording.values, **given), 7)
    ours = time_calls(
        lambda: fit_normalised(reduce([recording], terms), threshold=None, path_length=30), 31
    )
    return [
        report("stlsq with threshold selection, 30,001 x 4", ours, "s",
            "pysindy SINDy.fit of the same method at one threshold", peer / ours, ">= 10"),
    ]  # fmt: skip


def time_likelihood(results: Path) -> list[dict]:
    """Time maximum likelihood and a weak-form method on each recording of a study cell."""
    replicates = simulate_recordings(results, "state")
    terms = polynomial_library(4, 3)
    maximum_likelihood(list(replicates[0]), terms)

    def cost(method: Callable, every: int = 1) -> float:
        thinned = [[one[::every] for one in each] for each in replicates]
        return float(np.median([time_calls(partial(method, each, terms), 1) for each in thinned]))

    ours, weak, few = cost(maximum_likelihood), cost(weak_gls), cost(maximum_likelihood, every=10)
    return [
        report("maximum_likelihood on 30,001 x 4 at 0.05, median", ours, "s", bar="<= 1.0"),
        report("the same of every tenth sample", few, "s", "of all", ours / few, "<= 10"),
        report("weak_gls on all, median", weak, "s", "maximum_likelihood", ours / weak),
    ]


def time_command() -> list[dict]:
    """Measure the processor time of `galloping identify`, with the default threads and with one."""
    example, threads = ROOT / "examples/span", ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    default = {name: value for name, value in os.environ.items() if name not in threads}

    def cost(environment: dict[str, str]) -> float:
        with tempfile.TemporaryDirectory() as folder:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(
                [sys.executable, "-c", "from galloping.cli import main; main()", "identify",
                 f"{example}.csv", "--map", f"{example}.yaml", "--output", f"{folder}/span"],
                env=environment, check=True, capture_output=True,
            )  # fmt: skip
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    cost(default)  # compiled before
    one = cost(default | dict.fromkeys(threads, "1"))
    ours = cost(default)
    what = "galloping identify on the example, of a core"
    return [report(what, ours, "s", "the same with one thread", one / ours, "<= 8")]


def simulate_recordings(results: Path, protocol: str) -> list[tuple[Recording, ...]]:
    """Simulate noisy recordings of the default line, at noise level 0.05, by realisation."""
    cell = Study(load({})).cell(CASE, protocol, "noise_0.05")
    motions = read_trajectories(results / f"trajectories/{CASE}.npz")
    return recordings_of(motions, name=tuple(cell.wildcards.values()), **cell.measurement)


def read_costs(results: Path) -> pd.DataFrame:
    """Read the wall time, s, and memory, max_rss in MiB, of all jobs of a study with their rule."""
    folder = results / "benchmarks"
    return pd.concat(
        pd.read_csv(path, sep="\t", na_values="-").assign(
            rule=path.relative_to(folder).parts[0].removesuffix(".tsv")
        )
        for path in sorted(folder.rglob("*.tsv"))
    )


def tabulate_jobs(results: Path, older: Path | None) -> list[dict]:
    """Tabulate the largest memory of a job and job seconds by rule, also of an older study."""
    now, before = read_costs(results), read_costs(older) if older else None
    rows = [report("memory of the largest job", now["max_rss"].max(), "MiB", bar="<= 1024")]
    for study, when in ((now, ""), (before, " before")):
        for rule, table in study.groupby("rule") if study is not None else ():
            what = f"job seconds of {rule}{when}, {len(table)} jobs"
            rows.append(report(what, table["s"].sum(), "s"))
    peer = {}
    if older:
        ratio = now["s"].sum() / before["s"].sum()
        peer = {"peer": f"before, {len(before)} jobs", "ratio": ratio, "bar": "<= 0.333"}
    return [*rows, report(f"job seconds of all {len(now)} jobs", now["s"].sum(), "s", **peer)]


def time_planning(folder: str) -> list[dict]:
    """Time Snakemake's planning of the default study and of one of 5,000 jobs, in a copy."""
    larger = Path(folder) / "larger.yaml"
    levels = [round(0.001 * k, 3) for k in range(N_LEVELS)]
    larger.write_text(yaml.safe_dump({"results": "larger", "measurement": {"levels": levels}}))
    rows = []
    for options in ((), ("--configfile", str(larger))):
        command = [sys.executable, "-m", "snakemake", "-n", "--quiet", "rules", "--forceall"]
        start = time.perf_counter()
        run = subprocess.run(
            [*command, *options], cwd=folder, check=True, capture_output=True, text=True
        )
        jobs = re.search(r"^total +(\d+)$", run.stdout + run.stderr, re.MULTILINE)[1]
        rows.append(report(f"plan of {jobs} jobs", time.perf_counter() - start, "s"))
    return rows


def time_whole_runs() -> list[dict]:
    """Time the default and the smoke study from scratch, and a run with nothing to do."""
    tracked = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout.split("\0")
    with tempfile.TemporaryDirectory() as folder:
        for name in filter(None, tracked):
            target = Path(folder) / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target, follow_symlinks=False)

        def study(*options: str) -> float:
            snakemake = [sys.executable, "-m", "snakemake", "--quiet", "all", "--cores", "2"]
            start = time.perf_counter()
            subprocess.run([*snakemake, *options], cwd=folder, check=True)
            return time.perf_counter() - start

        smoke = study("--configfile", "config/smoke.yaml")
        return [
            report("smoke study and report, two cores", smoke, "s", bar="<= 60"),
            report("default study and report, two cores", study(), "s", bar="<= 480"),
            report("repetition with nothing to do", study(), "s", bar="<= 5"),
            *time_planning(folder),
        ]


def main(results: str, output: str, older: str | None = None) -> None:
    """Measure all speeds and write them to a table."""
    folder = Path(results)
    benchmarks = (time_integration, compare_simulation, time_selection, time_likelihood)
    rows = tabulate_jobs(folder, Path(older) if older else None)
    rows += [each for measure in benchmarks for each in measure(folder)]
    write_rows(output, [*rows, *time_command(), *time_whole_runs()])


if __name__ == "__main__":
    main(*sys.argv[1:])
