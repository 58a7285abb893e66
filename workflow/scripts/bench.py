"""Measured speed, as ratios against a peer in the same run: bench.py RESULTS OUTPUT.csv [OLDER].

RESULTS is a finished default study, for its motions and the cost of its jobs. OLDER is the results
folder of the same study by an older version, run on the same machine: the sums of job seconds
stand beside each other. The study, smoke and idle times are of real runs in a temporary copy of
the project. `make bench` sets one thread a process, as in a job, but where the default is measured.
"""

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import heyoka as hy
import numpy as np
import pandas as pd
import pysindy as ps
import yaml
from scipy.integrate import solve_ivp

from galloping.configuration.load import load
from galloping.identification.likelihood.condense import ORDER
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.problem import posed
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.sparse.evidence import reduce
from galloping.identification.sparse.stlsq import normalised
from galloping.measurement import measure
from galloping.polynomial import PolynomialModel, library
from galloping.recording import Recording
from galloping.simulation import Simulator, equations, time_grid
from galloping.storage import write_rows
from galloping.study.cells import Study
from galloping.study.files import read_model, read_trajectories
from galloping.taylor import integrate, system, tables

ROOT = Path(__file__).parents[2]
CASE = "internal_resonance"
LEVELS = 310  # noise levels of a study of 5,000 jobs


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
    told = (quantity, value, unit, peer, ratio, bar)
    return dict(zip(("quantity", "value", "unit", "peer", "ratio", "bar"), told, strict=True))


def simulation(results: Path) -> list[dict]:
    """A re-simulation of an identified model against pysindy's, and integrators compared."""
    line = read_model(results / f"models/{CASE}.json").model
    terms = library(len(line.states), 3)
    full = line.on_library(terms)
    motion = read_trajectories(results / f"trajectories/{CASE}.npz")[0]
    grid, exact = motion.time, motion.states
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
    reference = _solve(same, exact[0], grid, 3e-14)  # the strictest that scipy allows
    error = np.abs(simulator(same, exact[0], grid).states - reference).max()
    peer_error = np.abs(theirs - reference).max()

    dop = seconds(lambda: _solve(line, exact[0], grid, 1e-10), 1)
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


def _solve(line, x0, grid, tolerance):
    return solve_ivp(
        lambda _, x: line(x[np.newaxis])[0], (grid[0], grid[-1]), x0,
        method="DOP853", t_eval=grid, rtol=tolerance, atol=tolerance,
    ).y.T  # fmt: skip


def identification(results: Path) -> list[dict]:
    """Reduction and stlsq with threshold selection against one plain fit; growth with samples."""
    recording = recordings(results, "derivative")[0][0]
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
    line = read_model(results / f"models/{CASE}.json").model
    simulator = Simulator(line.states, line.terms)
    previous = None
    for n in (10_000, 100_000, 1_000_000):
        grid = time_grid(300.0, n / 300.0)
        states = simulator(line, np.array([0.1, 0.1, 0, 0]), grid).states
        rng = np.random.default_rng(0)
        noisy = line(states) + 0.05 * rng.standard_normal(states.shape)
        recording = Recording(grid, line.states, states, noisy)
        cost = seconds(partial(fit, recording), 3)
        peer = ("a tenth of the samples", cost / previous, "about 10") if previous else ()
        rows.append(row(f"the same, {n} x 4", cost, "s", *peer))
        previous = cost
    return rows


def limit(results: Path) -> list[dict]:
    """Maximum likelihood on every replicate of a cell, all stages, compiled before."""
    replicates = recordings(results, "state")
    terms = library(4, 3)
    maximum_likelihood(list(replicates[0]), terms)
    ours, weak = (
        np.median([seconds(partial(method, list(each), terms), 1) for each in replicates])
        for method in (maximum_likelihood, weak_gls)
    )
    return [
        row("maximum_likelihood on 30,001 x 4 at 0.05, median", ours, "s", bar="<= 1.0"),
        row("weak_gls on the same, median", weak, "s", "maximum_likelihood", ours / weak),
    ]


def command() -> list[dict]:
    """What the README's example costs a core, with the default threads and with one."""
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
    return [row(what, ours, "s", "the same with one thread", one / ours, "<= 8")]


def sensitivity(results: Path) -> list[dict]:
    """The compiled Taylor integrator with its projections beside heyoka's variational equations.

    Both of the whole library's free coefficients and of the initial state, over 300 s.
    """
    line = read_model(results / f"models/{CASE}.json").model.on_library(library(4, 3))
    start = read_trajectories(results / f"trajectories/{CASE}.npz")[0].states[0]
    free, steps = posed(line.states, line.terms).candidates, 2048
    compiled = system(tables(line.terms, len(line.states)), line.coefficients, free)
    functionals = np.ones((steps, len(line.states), 2, ORDER + 1))
    ours = partial(
        integrate, compiled, 300.0 / steps, np.array([0, steps]), start[np.newaxis], functionals,
        np.arange(len(line.states)), np.zeros((steps, 1, 0)), sensitive=True,
    )  # fmt: skip
    ours()

    support = line.support
    support[tuple(free.T)] = True
    places, rates = np.argwhere(support).tolist(), equations(line.states, line.terms, support)
    by = [*(v for v, _ in rates), *(hy.par[places.index(place)] for place in free.tolist())]
    integrator = hy.taylor_adaptive(
        hy.var_ode_sys(rates, by, order=1), list(start), pars=list(line.coefficients[support]),
        tol=1e-9, compact_mode=True,
    )  # fmt: skip
    begin = integrator.state.copy()

    def theirs() -> None:
        integrator.time, integrator.state[:] = 0.0, begin
        integrator.propagate_until(300.0)

    mine, peer = seconds(ours, 15), seconds(theirs, 15)
    what = f"sensitivities to {len(free)} coefficients with projections, 300 s"
    return [row(what, mine, "s", "heyoka's variational equations without output", peer / mine)]


def recordings(results: Path, protocol: str) -> list[tuple[Recording, ...]]:
    """Those of the default study at noise level 0.05, by replicate."""
    cell = Study(load({})).cell(CASE, protocol, "noise_0.05")
    motions = read_trajectories(results / f"trajectories/{CASE}.npz")
    return measure(motions, name=tuple(cell.wildcards.values()), **cell.measurement)


def costs(results: Path) -> pd.DataFrame:
    """Snakemake's benchmarks of all jobs: rule, s (wall time), max_rss (MiB)."""
    folder = results / "benchmarks"
    return pd.concat(
        pd.read_csv(path, sep="\t", na_values="-").assign(
            rule=path.relative_to(folder).parts[0].removesuffix(".tsv")
        )
        for path in sorted(folder.rglob("*.tsv"))
    )


def jobs(results: Path, older: Path | None) -> list[dict]:
    """Sums of job seconds, by rule, and largest resident set of a job; beside an older study."""
    now, before = costs(results), costs(older) if older else None
    rows, peer = [row("memory of the largest job", now["max_rss"].max(), "MiB", bar="<= 1024")], {}
    for study, when in ((now, ""), (before, " before")):
        for rule, table in study.groupby("rule") if study is not None else ():
            what = f"job seconds of {rule}{when}, {len(table)} jobs"
            rows.append(row(what, table["s"].sum(), "s"))
    if older:
        ratio = now["s"].sum() / before["s"].sum()
        peer = {"peer": f"before, {len(before)} jobs", "ratio": ratio, "bar": "<= 0.333"}
    return [*rows, row(f"job seconds of all {len(now)} jobs", now["s"].sum(), "s", **peer)]


def planning(folder: str) -> list[dict]:
    """Time to plan, in a copy of the project, the default study and one of 5,000 jobs."""
    larger = Path(folder) / "larger.yaml"
    levels = [round(0.001 * k, 3) for k in range(LEVELS)]
    larger.write_text(yaml.safe_dump({"results": "larger", "measurement": {"levels": levels}}))
    rows = []
    for options in ((), ("--configfile", str(larger))):
        command = [sys.executable, "-m", "snakemake", "-n", "--quiet", "rules", "--forceall"]
        start = time.perf_counter()
        run = subprocess.run(
            [*command, *options], cwd=folder, check=True, capture_output=True, text=True
        )
        jobs = re.search(r"^total +(\d+)$", run.stdout + run.stderr, re.MULTILINE)[1]
        rows.append(row(f"plan of {jobs} jobs", time.perf_counter() - start, "s"))
    return rows


def whole_runs() -> list[dict]:
    """Default and smoke study from nothing on two cores, and a repetition with nothing to do."""
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
            row("smoke study and report, two cores", smoke, "s", bar="<= 60"),
            row("default study and report, two cores", study(), "s", bar="<= 480"),
            row("repetition with nothing to do", study(), "s", bar="<= 5"),
            *planning(folder),
        ]


def main(results: str, output: str, older: str | None = None) -> None:
    folder, measured = Path(results), (simulation, identification, limit, sensitivity)
    rows = jobs(folder, Path(older) if older else None)
    rows += [each for measure in measured for each in measure(folder)]
    write_rows(output, [*rows, *command(), *whole_runs()])


if __name__ == "__main__":
    main(*sys.argv[1:])
