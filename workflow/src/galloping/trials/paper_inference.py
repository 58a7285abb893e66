"""Inference of the paper's unprinted numbers, for one reading of its words and digits.

The likelihood of a setting is that of `paper.agreement`, estimated from a few draws of the noise.
The estimate is unbiased, so importance sampling with it integrates the unknowns out exactly as if
the likelihood were known (pseudo-marginal; C. Andrieu and G. O. Roberts 2009): settings are drawn
from a proposal and weighted by prior times likelihood over proposal. The mean weight estimates the
evidence of the reading, with a standard error; the weighted settings are the posterior.

Pilot rounds with few draws find the proposal (population Monte Carlo; J.-M. Cornuet et al. 2012):
the first is uniform, each further one a multivariate t about the weighted settings so far. The last
round, with more draws, alone gives the evidence and the posterior, which are therefore unbiased.
Every reading gets the same numbers of rounds, settings and draws.

Settings are proposed in coordinates in which the likelihood is simpler, and which differ from the
logarithms of the unknowns by a shift alone, so that the prior density is the same: the vertical
damping over that at which the line ceases to gallop, the threshold over the smallest coefficient,
and the initial displacement over the final amplitude of the motion.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from galloping.configuration.load import load, plain
from galloping.evaluation.motion import steady_amplitude
from galloping.line.galerkin import coefficients
from galloping.model.polynomial import PolynomialModel
from galloping.paper import agreement
from galloping.paper.draws import Amounts, line_motion
from galloping.paper.quick import DRAWS_PER_SUBSET, MAX_STATE_SUM, QuickStudy
from galloping.paper.unknowns import (
    BOTH_LINES,
    FIRST_READING,
    LOG_HIGH,
    LOG_LOW,
    READINGS_BY_NAME,
    UNKNOWN_NAMES,
    UNKNOWNS,
    Reading,
)
from galloping.recording.measurement import Motion
from galloping.streams import make_generator

AMOUNTS = Amounts()
OTHER_CASE = "non_resonant"  # the paper's other line, whose motion it also calls steady
MAX_AMPLITUDE_CHANGE = 0.05  # relative amplitude change of a motion that may be called steady
SETTLING_RATE = 10.0  # Hz: sampling rate that suffices for an amplitude
MIN_AMPLITUDE = 0.02  # m: amplitude of a line that gallops
PILOT_ROUNDS = (40, 30, 30)  # settings of each pilot round
PILOT_DRAWS = 8  # realisations of each of these settings
FINAL_SETTINGS, FINAL_DRAWS = 48, 32  # settings of the last round, and realisations of each
UNIFORM_SHARE = 0.1  # share of uniform proposals in every round after the first
N_REFINED = 2  # most likely settings, which are judged again by new realisations
CLIMB_SETTINGS = 80  # settings tried in the maximisation from the most likely one
CLIMB_DRAWS = 48  # realisations of each of these settings, all with the same random numbers
FIRST_CLIMB_STEP = 0.1  # initial step in the logarithms of the unknowns
SUMMIT_DRAWS = 400  # realisations of the setting at the maximum
TAIL_FREEDOM = 5.0  # degrees of freedom of the proposals' t distribution
COVARIANCE_FACTOR = 1.3  # covariance of a proposal over that of the settings
MIN_UNTEMPERED_SETTINGS = 15.0  # limit below which weights are tempered before a fit
FIRST_ROUND = {  # ranges of the first proposals, ratios: see above
    "damping_vertical": (0.2, 1.0),
    "threshold": (1e-2, 1.0),
    "initial_vertical": (0.5, 2.0),
    "initial_horizontal": (0.5, 2.0),
}
FIRST_LOW, FIRST_HIGH = np.log([FIRST_ROUND.get(u.name, (u.low, u.high)) for u in UNKNOWNS]).T


@cache
def _default_case(name: str) -> dict:
    return plain(load({}))["cases"][name]


@dataclass(frozen=True)
class Proposal:
    """Proposal density of importance sampling for the parameters the paper does not state.

    It is over shifted coordinates, (n_unknowns,). centre, covariance: of a multivariate t, or None
    for the uniform density of the first round. uniform: share of that uniform density in a mixture
    of both.
    """

    centre: np.ndarray | None = None
    covariance: np.ndarray | None = None
    uniform: float = 0.0

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """Draw one random parameter vector from the proposal density."""
        if self.centre is None or rng.random() < self.uniform:
            return rng.uniform(FIRST_LOW, FIRST_HIGH)
        return np.atleast_1d(self._t_density.rvs(random_state=rng))

    def log_density(self, points: np.ndarray) -> np.ndarray:
        """Compute the logarithm of the proposal density at given parameter vectors.

        points: (k, n_unknowns). Returns (k,).
        """
        inside = np.all((points >= FIRST_LOW) & (points <= FIRST_HIGH), axis=1)
        flat = np.where(inside, -np.sum(np.log(FIRST_HIGH - FIRST_LOW)), -np.inf)
        if self.centre is None:
            return flat
        with np.errstate(divide="ignore"):
            shares = np.log([1.0 - self.uniform, self.uniform])
        return np.logaddexp(shares[0] + self._t_density.logpdf(points), shares[1] + flat)

    @property
    def _t_density(self):
        return multivariate_t(self.centre, self.covariance, df=TAIL_FREEDOM)

    @classmethod
    def fit(cls, points: np.ndarray, log_weights: np.ndarray, uniform: float) -> "Proposal":
        """Fit a proposal density, a multivariate t distribution, to weighted parameter vectors.

        Weights are tempered if few settings count.
        """
        power, weights = 1.0, _normalise_weights(log_weights)
        while agreement.effective_number(weights) < min(MIN_UNTEMPERED_SETTINGS, len(points) / 2):
            power *= 0.8
            weights = _normalise_weights(power * log_weights)
        centre = weights @ points
        covariance = COVARIANCE_FACTOR * np.cov(points.T, aweights=weights, ddof=0)
        return cls(centre, covariance + 1e-3 * np.eye(len(centre)), uniform)


def _normalise_weights(log_weights: np.ndarray) -> np.ndarray:
    return np.exp(log_weights - logsumexp(log_weights))


def trial(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    pilot_rounds: Sequence[int] = PILOT_ROUNDS,
    pilot_draws: int = PILOT_DRAWS,
    settings: int = FINAL_SETTINGS,
    draws: int = FINAL_DRAWS,
    climb: int = CLIMB_SETTINGS,
) -> Iterator[dict[str, object]]:
    """Infer by importance sampling the parameters the paper does not state; yield the samples.

    There is a row for each setting of the last round of one reading of the paper, and rows for its
    draws. seed: of the random numbers. case: name of the reading in `READINGS_BY_NAME`. replicates:
    independent runs. pilot_rounds, pilot_draws: as the constants of these names. settings, draws:
    FINAL_SETTINGS, FINAL_DRAWS. climb: CLIMB_SETTINGS. For the first reading alone the most
    probable setting is optimised, since it is that of the default study. Yields stage `tried`: a
    setting with log_likelihood, those without each group of claims, and by factor; log_weight: of
    prior times likelihood over proposal and number of proposed settings, so that the weights of a
    run add up to its evidence. Stage `draw`: a draw at that setting, with the value of each claim.
    Stage `judged`: one of the most probable settings with its likelihood from fresh draws.
    """
    reading = READINGS_BY_NAME[case]
    for replicate in replicates:
        rng = make_generator(seed, "inference", case, replicate)
        proposal = _learn_proposal(reading, pilot_rounds, pilot_draws, rng)
        setting_rows, proposed = _try_settings(reading, proposal, settings, draws, rng)
        keys = {"reading": case, "replicate": replicate}
        log_weights = _log_weights(setting_rows, [proposal], [proposed])
        for row, log_weight in zip(setting_rows, log_weights, strict=True):
            draw_rows = row.pop("draws")
            del row["point"]
            yield {**keys, "stage": "tried", "proposed": proposed, **row,
                   "log_weight": log_weight}  # fmt: skip
            motion = {name: row[name] for name in ("change", "attack")}
            yield from ({**keys, "stage": "draw", **motion, **values} for values in draw_rows)
        best = sorted(setting_rows, key=lambda row: -row["log_likelihood"])[:N_REFINED]
        again = [_judge_setting(reading, row, draws, rng) for row in best]
        if reading == FIRST_READING and climb:
            top = max(again, key=lambda row: row["log_likelihood"])
            again.append(
                _judge_setting(
                    reading, _climb_likelihood(reading, top, climb, rng), SUMMIT_DRAWS, rng
                )
            )
        yield from ({**keys, "stage": "judged", **row} for row in again)


def _learn_proposal(
    reading: Reading, rounds: Sequence[int], draws: int, rng: np.random.Generator
) -> Proposal:
    """Find the proposal of the last round, from pilot rounds weighted by their mixture."""
    rows, proposals, numbers = [], [Proposal()], []
    for count in rounds:
        new_rows, proposed = _try_settings(reading, proposals[-1], count, draws, rng)
        rows += new_rows
        numbers.append(proposed)
        points = np.stack([row["point"] for row in rows])
        log_weights = _log_weights(rows, proposals, numbers)
        proposals.append(Proposal.fit(points, log_weights, UNIFORM_SHARE))
    return proposals[-1]


def _log_weights(
    rows: Sequence[Mapping], proposals: Sequence[Proposal], numbers: Sequence[int]
) -> np.ndarray:
    """Compute logarithms of prior times likelihood over the mixture and number of proposals."""
    points = np.stack([row["point"] for row in rows])
    shares = np.log(numbers)[:, np.newaxis]
    densities = np.stack([proposal.log_density(points) for proposal in proposals])
    log_prior = -np.sum(np.log(LOG_HIGH - LOG_LOW))
    log_likelihoods = np.array([row["log_likelihood"] for row in rows])
    return log_prior + log_likelihoods - logsumexp(shares + densities, axis=0)


def _judge_setting(
    reading: Reading, values: Mapping[str, float], draws: int, rng: np.random.Generator
) -> dict[str, float]:
    """Compute the likelihood of a setting from fresh draws."""
    setting = {name: values[name] for name in UNKNOWN_NAMES}
    judgment = estimate(reading, setting, draws, rng)
    if judgment is None:
        raise ValueError("the conditions of the reading exclude the setting")
    judgment.pop("draws")
    return setting | judgment


def _climb_likelihood(
    reading: Reading, start: Mapping[str, float], settings: int, rng: np.random.Generator
) -> dict[str, float]:
    """Find the most probable setting near another one (J. A. Nelder and R. Mead 1965).

    All settings share their random numbers, so that the likelihood changes smoothly among them.
    """
    seed = int(rng.integers(2**63))

    def miss(point: np.ndarray) -> float:
        if np.any((point < LOG_LOW) | (point > LOG_HIGH)):
            return np.inf
        values = dict(zip(UNKNOWN_NAMES, np.exp(point), strict=True))
        smallest = _smallest_coefficient(_line_coefficients(reading, values))
        if reading.has_threshold_in_units and values["threshold"] > smallest:
            return np.inf
        found = estimate(reading, values, CLIMB_DRAWS, np.random.default_rng(seed))
        return np.inf if found is None else -found["log_likelihood"]

    first = np.log([start[name] for name in UNKNOWN_NAMES])
    simplex = first + np.vstack(
        [np.zeros(len(UNKNOWN_NAMES)), FIRST_CLIMB_STEP * np.eye(len(UNKNOWN_NAMES))]
    )
    options = {"initial_simplex": simplex, "maxfev": settings, "adaptive": True}
    end = minimize(miss, first, method="Nelder-Mead", options=options)
    return dict(zip(UNKNOWN_NAMES, np.exp(end.x), strict=True))


def _line_coefficients(reading: Reading, values: Mapping[str, float]) -> list[dict[str, float]]:
    return [coefficients(_case_at(reading, values, name)) for name in (agreement.CASE, OTHER_CASE)]


def _smallest_coefficient(lines: Sequence[Mapping[str, float]]) -> float:
    """Find the smallest coefficient of all lines, which a larger threshold removes."""
    return min(abs(value) for line in lines for value in line.values() if value)


def _try_settings(
    reading: Reading, proposal: Proposal, count: int, draws: int, rng: np.random.Generator
) -> tuple[list[dict], int]:
    """Draw settings of a proposal until `count` of them are possible; also count the proposals."""
    rows: list[dict] = []
    proposed = 0
    while len(rows) < count:
        proposed += 1
        point = proposal.draw(rng)
        values = setting_at(reading, point)
        if values is None:
            continue
        row = estimate(reading, values, draws, rng)
        if row is not None:
            rows.append({**values, "point": point, **row})
    return rows, proposed


def setting_at(reading: Reading, point: np.ndarray) -> dict[str, float] | None:
    """Convert a sampled point to parameters of the paper's study, None if they are impossible.

    The point is in shifted coordinates. Excluded are values outside their ranges, lines that do not
    gallop or whose cycle exceeds the largest attack angle, and thresholds above the smallest
    coefficient of both lines, which would be lost without noise.
    """
    ratios = dict(zip(UNKNOWN_NAMES, np.exp(point), strict=True))
    values = ratios | {"damping_vertical": 0.0, "initial_vertical": 1.0, "initial_horizontal": 1.0}
    if not _is_in_range(values, [name for name in UNKNOWN_NAMES if name not in FIRST_ROUND]):
        return None
    undamped = coefficients(_case_at(reading, values, agreement.CASE))
    critical = -undamped["gamma_1"] / (2 * np.sqrt(undamped["gamma_2"]))
    values["damping_vertical"] = ratios["damping_vertical"] * critical
    if not _is_in_range(values, ["damping_vertical"]):
        return None
    lines = _line_coefficients(reading, values)
    if any(line["gamma_1"] >= 0 for line in lines):
        return None
    values["threshold"] = ratios["threshold"] * _smallest_coefficient(lines)
    if reading.has_threshold_in_units and ratios["threshold"] > 1:
        return None
    if not _is_in_range(values, ["threshold"]):
        return None
    started = {**values, "initial_vertical": 0.5, "initial_horizontal": 0.5}
    settled, _ = line_motion(
        _case_at(reading, started, agreement.CASE), AMOUNTS.duration, SETTLING_RATE
    )
    last = settled.states[-round(AMOUNTS.duration * SETTLING_RATE / 6) :]
    amplitude = steady_amplitude(last[:, :2])
    if not amplitude.min() > MIN_AMPLITUDE or not _is_in_reach(settled):
        return None
    if np.abs(last[:, 2]).max() > reading.attack_limit * values["wind_speed"]:
        return None
    for name, each in zip(("initial_vertical", "initial_horizontal"), amplitude, strict=True):
        values[name] = ratios[name] * each
    return values if _is_in_range(values, UNKNOWN_NAMES) else None


def _is_in_range(values: Mapping[str, float], names: Sequence[str]) -> bool:
    return all(u.low <= values[u.name] <= u.high for u in UNKNOWNS if u.name in names)


def _case_at(reading: Reading, values: Mapping[str, float], name: str) -> dict:
    return reading.case_at(values, _default_case(name))


def estimate(
    reading: Reading, values: Mapping[str, float], draws: int, rng: np.random.Generator
) -> dict[str, Any] | None:
    """Estimate the likelihood of parameters from simulated noise realisations.

    Returns None if a condition excludes the parameters. log_likelihood: of all that is printed.
    without_NAME: of all but one of `agreement.CLAIM_GROUPS`. By the name of each factor: its
    logarithm. change: of the amplitudes, of the lines that are read as steady. attack: largest
    |dq_v| / U. draws: value of each claim by draw.
    """
    motion, line = _simulate_line(reading, values, agreement.CASE)
    if not _is_in_reach(motion):
        return None
    changes = [_amplitude_change(motion.states)]
    if reading.steady == BOTH_LINES:
        other, _ = _simulate_line(reading, values, OTHER_CASE)
        changes.append(_amplitude_change(other.states))
    attack = float(np.abs(motion.states[:, 2]).max() / values["wind_speed"])
    is_steady = max(changes) < MAX_AMPLITUDE_CHANGE
    if attack > reading.attack_limit or (reading.steady and not is_steady):
        return None
    steady = agreement.log_steadiness(np.array(changes)) if reading.steady else 0.0
    method = reading.method_at(values)
    study = QuickStudy(motion, line, AMOUNTS)
    scores = study.draw_scores(method, draws, rng, unsimulated_levels=agreement.UNSIMULATED_LEVELS)
    claims = agreement.scores_by_claim(scores)
    factors = agreement.log_likelihoods(claims)
    log_likelihood = sum(factors.values()) + steady
    row: dict[str, Any] = {"change": max(changes), "attack": attack}
    row |= {"log_likelihood": log_likelihood, **factors}
    for group in agreement.CLAIM_GROUPS:
        others = agreement.log_likelihoods(claims, left_out=(group,))
        row[f"without_{group}"] = sum(others.values()) + steady
    # those that share no random subset
    rows = range(0, draws, DRAWS_PER_SUBSET if draws > DRAWS_PER_SUBSET else 1)
    row["draws"] = [{name: found[k] for name, found in claims.items()} for k in rows]
    return row


def _simulate_line(
    reading: Reading, values: Mapping[str, float], case: str
) -> tuple[Motion, PolynomialModel]:
    return line_motion(_case_at(reading, values, case), AMOUNTS.duration, AMOUNTS.sampling_rate)


def _is_in_reach(motion: Motion) -> bool:
    """Decide whether a line moves no farther than `quick` simulates a model."""
    return bool(np.abs(motion.states).sum(axis=1).max() < MAX_STATE_SUM)


def _amplitude_change(states: np.ndarray) -> float:
    """Compute the largest change of an amplitude between the halves of the steady window."""
    first, last = (round(t * AMOUNTS.sampling_rate) for t in AMOUNTS.steady_window)
    middle = (first + last) // 2
    early = steady_amplitude(states[first:middle, :2])
    late = steady_amplitude(states[middle : last + 1, :2])
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.max(np.abs(late / early - 1)))
