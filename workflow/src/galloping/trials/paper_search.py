"""Settings of what the paper leaves out at which its printed numbers are probable.

A reading of the paper is searched from settings at random, those first whose motion is steady, by
an evolution strategy (CMA-ES; Hansen 2016) that climbs the probability of `paper.unknowns`.

The probability of a setting is known from a few draws of the noise, and scatters. A Gaussian
process through all settings tried smooths it, another one tells which motions are steady; both
together are sampled by emcee (Foreman-Mackey et al. 2013) for the region where the paper's numbers
are probable. This is Bayesian optimisation for likelihood-free inference (Gutmann and Corander
2016) with the search's settings as design.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from operator import itemgetter

import cma
import emcee
import numpy as np
import pandas as pd
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from galloping.configuration.load import load, plain
from galloping.evaluation.motion import steady_amplitude
from galloping.measurement import Motion
from galloping.paper import unknowns
from galloping.paper.draws import Amounts, line_motion
from galloping.paper.quick import FARTHEST, SHARING, QuickStudy
from galloping.paper.unknowns import BY_NAME, HIGH, LOW, NAMES, MethodReading, Variant
from galloping.physics.galerkin import coefficients
from galloping.streams import generator

AMOUNTS = Amounts()
STEADY = 0.02  # relative change of amplitude between the halves of the steady window
SMALLEST = 0.02  # m: a line that moves less does not gallop
NEAR = 0.5  # of the logarithm of the limit cycle's amplitude: how far from it settings are released
DRAWS, SCREENED, EVALUATIONS, JUDGED = 32, 24, 120, 200
FEWEST = 3  # of each, where they are dear
SPREAD = 0.25  # of the logarithms, first step of the evolution strategy
FINALISTS = 4  # settings that are judged again by draws of their own
# Settings that earlier searches of the first reading found: the first search of each reading tries
# them too, so that no reading is ruled out for want of a start.
STARTS = tuple(
    dict(zip(NAMES, values, strict=True))
    for values in (
        (9.69, 0.0059, 0.0043, 0.471, 0.754, 0.1104, 0.0031),
        (7.6, 0.0054, 0.0031, 0.5, 0.71, 0.134, 0.0031),
        (3.12, 0.0016, 0.0014, 0.64, 0.95, 0.215, 0.0008),
    )
)
IMPOSSIBLE = -1e3  # logarithm of the probability of a motion that is not steady, and less


@cache
def _line(name: str) -> dict:
    return plain(load({}))["cases"][name]


def trial(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    draws: int = DRAWS,
    screened: int = SCREENED,
    evaluations: int = EVALUATIONS,
    judged: int = JUDGED,
) -> Iterator[dict[str, object]]:
    """A row for each setting that a search of one reading of the paper tries.

    case: name in `unknowns.BY_NAME`. replicates: searches. draws: of the noise at each setting.
    screened: settings at random, beside STARTS in the first search. evaluations: settings that the
    strategy tries. judged: draws of the best setting, which no search saw.
    stage: `screened`, `searched`; `draw`, a draw of a setting that was tried, with its value of
    each claim; `best`, with the share of draws below each printed number, or that keep each bound.
    height: what is climbed, log_probability or, where that is NaN, how far a motion is from steady.
    """
    variant = BY_NAME[case]
    draws, screened, evaluations, judged = (
        max(FEWEST, number // variant.cost) for number in (draws, screened, evaluations, judged)
    )
    for replicate in replicates:
        rng = generator(seed, "inference", case, replicate)
        named = {"variant": case, "replicate": replicate}
        tried = [*STARTS[: 0 if replicate else None], *_at_random(variant, screened, rng)]
        rows = [{"stage": "screened", **evaluated(variant, values, draws, rng)} for values in tried]
        start = max(rows, key=itemgetter("height"))
        strategy = cma.CMAEvolutionStrategy(
            np.log([start[name] for name in NAMES]),
            SPREAD,
            {"bounds": [list(LOW), list(HIGH)], "seed": int(rng.integers(1, 2**31)), "verbose": -9},
        )
        while len(rows) < len(tried) + evaluations and not strategy.stop():
            points = strategy.ask()
            settings = [dict(zip(NAMES, np.exp(x), strict=True)) for x in points]
            found = [
                {"stage": "searched", **evaluated(variant, values, draws, rng)}
                for values in settings
            ]
            strategy.tell(points, [-row["height"] for row in found])
            rows += found
        for row in rows:
            drawn = row.pop("draws", [])
            yield {**named, **row}
            yield from ({**named, **row, "stage": "draw", **draw} for draw in drawn)
        yield {**named, "stage": "best", **_best(variant, rows, judged, rng)}


def _best(
    variant: Variant, rows: Sequence[Mapping], draws: int, rng: np.random.Generator
) -> dict[str, float]:
    """The best of the highest settings, by draws of its own: the highest was lucky in part."""
    highest = sorted(rows, key=itemgetter("height"), reverse=True)[:FINALISTS]
    values = [{name: row[name] for name in NAMES} for row in highest]
    again = [evaluated(variant, each, draws, rng, summed=True) for each in values]
    best = max(range(len(again)), key=lambda k: again[k]["height"])
    return evaluated(variant, values[best], draws, rng, summed=True)


def evaluated(
    variant: Variant,
    values: Mapping[str, float],
    draws: int,
    rng: np.random.Generator,
    summed: bool = False,
) -> dict[str, float]:
    """One setting: its motion, and how probable the paper's numbers are, NaN where it is excluded.

    summed: with the shares of draws of each claim instead of one draw.
    """
    row = {**values, "change": np.nan, "log_probability": np.nan, "height": 10 * IMPOSSIBLE}
    case, setting = variant.case(_line(unknowns.CASE), values), variant.method(values)
    weakest = _weakest(variant, values) / setting.threshold if _is_raw(setting) else np.inf
    if weakest < 1:  # no recovery without noise, in either case
        return {**row, "height": 2 * IMPOSSIBLE + 100 * np.log(weakest)}
    motion, line = line_motion(case, AMOUNTS.duration, AMOUNTS.sampling_rate)
    amplitude, row["change"] = steadiness(motion.states)
    if not amplitude > SMALLEST or not _stays(motion):
        return row
    if variant.steady and row["change"] >= STEADY:
        return {**row, "height": IMPOSSIBLE - 100 * np.log(row["change"] / STEADY)}
    study = QuickStudy(motion, line, AMOUNTS)
    scores = study.draws(setting, draws, rng, still=unknowns.STILL)
    logs = unknowns.log_probabilities(scores)
    row["log_probability"] = row["height"] = sum(logs.values())
    row["without_amplitudes"] = sum(
        unknowns.log_probabilities(scores, left_out=("amplitude",)).values()
    )
    if summed:
        return row | logs | dict(unknowns.shares(scores))
    # those that share no random subset
    return row | logs | {"draws": [unknowns.one_draw(scores, k) for k in range(0, draws, SHARING)]}


def evaluated_scores(
    variant: Variant, values: Mapping[str, float], draws: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Draws of the paper's study at one setting, whatever its motion."""
    case = variant.case(_line(unknowns.CASE), values)
    study = QuickStudy(*line_motion(case, AMOUNTS.duration, AMOUNTS.sampling_rate), AMOUNTS)
    return study.draws(variant.method(values), draws, rng, still=unknowns.STILL)


def _is_raw(setting: MethodReading) -> bool:
    return setting.columns == "raw" and setting.threshold is not None


def _weakest(variant: Variant, values: Mapping[str, float]) -> float:
    """The smallest coefficient of both of the paper's lines."""
    both = [coefficients(variant.case(_line(n), values)) for n in (unknowns.CASE, "non_resonant")]
    return min(abs(value) for each in both for value in each.values() if value)


def _stays(motion: Motion) -> bool:
    """Whether a line moves no farther than `quick` follows a model."""
    return bool(np.abs(motion.states).sum(axis=1).max() < FARTHEST)


def steadiness(states: np.ndarray) -> tuple[float, float]:
    """The smallest amplitude in a half of the steady window, the largest change between them."""
    first, last = (round(t * AMOUNTS.sampling_rate) for t in AMOUNTS.steady_window)
    middle = (first + last) // 2
    early, late = (
        steady_amplitude(states[rows, :2])
        for rows in (slice(first, middle), slice(middle, last + 1))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(min(early.min(), late.min())), float(np.max(np.abs(late / early - 1)))


def _at_random(
    variant: Variant, number: int, rng: np.random.Generator
) -> Iterator[dict[str, float]]:
    """Settings at random within the ranges, released near the amplitude that they end with."""
    found = 0
    while found < number:
        values = dict(zip(NAMES, np.exp(rng.uniform(LOW, HIGH)), strict=True))
        weakest = _weakest(variant, values)
        if _is_raw(variant.method(values)) and values["threshold"] > weakest:
            continue
        case = variant.case(
            _line(unknowns.CASE), {**values, "release_vertical": 0.5, "release_horizontal": 0.5}
        )
        if coefficients(case)["gamma_1"] >= 0:
            continue  # the line does not gallop in this wind
        motion, _ = line_motion(case, 3 * AMOUNTS.duration, 10.0)
        amplitude = steady_amplitude(motion.states[-1000:, :2])
        if not amplitude.min() > SMALLEST or not _stays(motion):
            continue
        release = np.log(amplitude) + rng.uniform(-NEAR, NEAR, size=2)
        values |= dict(zip(NAMES[3:5], np.exp(np.clip(release, LOW[3:5], HIGH[3:5])), strict=True))
        found += 1
        yield values


DEPTH = 12.0  # below the highest: settings that are that much less probable shape no region
MOST = 600  # settings that the process is fitted to, which costs their number cubed
WALKERS, STEPS, BURN_IN = 40, 1500, 500
SAMPLES = 400


def samples(rows: pd.DataFrame, column: str, seed: int) -> pd.DataFrame:
    """Settings of one reading, (SAMPLES, unknowns), as often as the paper's numbers are probable.

    rows: of `trial`, stages `screened` and `searched`. column: `log_probability` or
    `without_amplitudes`.
    """
    tried = rows[rows["stage"].isin(("screened", "searched"))]
    known = tried[np.isfinite(tried[column])].sort_values(column, ascending=False)
    known = known[known[column] > known[column].iloc[0] - DEPTH].head(MOST)
    x, height = _scaled(known), known[column].to_numpy(float)
    surface = _process(x, height - height.mean())
    moved = tried[np.isfinite(tried["change"])].sort_values("height", ascending=False).head(MOST)
    changes = np.log(np.clip(moved["change"].to_numpy(float), 1e-4, 1.0) / STEADY)
    steady = _process(_scaled(moved), changes)
    ends = x.min(axis=0) - 0.05, x.max(axis=0) + 0.05  # the process knows nothing beyond

    def log_probability(points: np.ndarray) -> np.ndarray:
        found = surface.predict(points)
        inside = np.all(
            (points >= np.maximum(ends[0], 0)) & (points <= np.minimum(ends[1], 1)), axis=1
        )
        return np.where(inside & (steady.predict(points) < 0), found, -np.inf)

    rng = generator(seed, "region", column)
    start = np.resize(x, (max(len(x), 20 * WALKERS), len(NAMES)))
    start = start + 1e-3 * rng.standard_normal(start.shape)
    start = start[np.isfinite(log_probability(start))][:WALKERS]
    sampler = emcee.EnsembleSampler(WALKERS, len(NAMES), log_probability, vectorize=True)
    sampler.random_state = np.random.RandomState(rng.integers(2**31)).get_state()
    sampler.run_mcmc(start, STEPS, skip_initial_state_check=True)
    chain = sampler.get_chain(discard=BURN_IN, flat=True)
    chosen = chain[rng.choice(len(chain), size=SAMPLES, replace=False)]
    return pd.DataFrame(np.exp(LOW + chosen * (HIGH - LOW)), columns=list(NAMES))


def predicted(
    variant: Variant, settings: pd.DataFrame, draws: int, seed: int
) -> dict[str, np.ndarray]:
    """What a draw of the paper's study at each of the settings gives for each printed number."""
    rng = generator(seed, "predicted")
    tables = [
        evaluated_scores(variant, values, draws, rng) for values in settings.to_dict("records")
    ]
    return {
        claim.name: np.concatenate([claim.values(table) for table in tables])
        for claim in unknowns.NUMBERS
    }


def _scaled(rows: pd.DataFrame) -> np.ndarray:
    return (np.log(rows[list(NAMES)].to_numpy(float)) - LOW) / (HIGH - LOW)


def _process(x: np.ndarray, y: np.ndarray) -> GaussianProcessRegressor:
    kernel = ConstantKernel(4.0, (1e-2, 1e3)) * RBF(np.full(x.shape[1], 0.3), (0.02, 10.0))
    kernel += WhiteKernel(1.0, (1e-3, 20.0))
    process = GaussianProcessRegressor(kernel, normalize_y=True, random_state=0)
    with warnings.catch_warnings():  # an unknown that does not matter has no length scale
        warnings.simplefilter("ignore", ConvergenceWarning)
        return process.fit(x, y)
