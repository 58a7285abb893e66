"""The region of what the paper leaves out, from the settings that a search has tried.

The probability of a setting is known from a few draws of the noise, and scatters. A Gaussian
process through all settings tried smooths it, another one tells which motions are steady; both
together are sampled by emcee (Foreman-Mackey et al. 2013). This is Bayesian optimisation for
likelihood-free inference (Gutmann and Corander 2016) with the search's settings as design.
"""

import warnings

import emcee
import numpy as np
import pandas as pd
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from galloping.paper.inference import STEADY, evaluated_scores
from galloping.paper.likelihood import NUMBERS
from galloping.paper.unknowns import HIGH, LOW, NAMES, Variant
from galloping.seeds import generator

DEPTH = 12.0  # below the highest: settings that are that much less probable shape no region
MOST = 600  # settings that the process is fitted to, which costs their number cubed
WALKERS, STEPS, BURN_IN = 40, 1500, 500
SAMPLES = 400


def samples(rows: pd.DataFrame, column: str, seed: int) -> pd.DataFrame:
    """Settings of one reading, (SAMPLES, unknowns), as often as the paper's numbers are probable.

    rows: of `inference.trial`, stages `screened` and `searched`. column: `log_probability` or
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
        claim.name: np.concatenate([claim.values(table) for table in tables]) for claim in NUMBERS
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
