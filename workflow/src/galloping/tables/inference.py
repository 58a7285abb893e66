"""Inference of the paper's unprinted numbers: readings, region, predictions, pairs."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import pandas as pd

from galloping.configuration.kinds import equal_effort
from galloping.model.intervals import QUANTILES_90
from galloping.paper.agreement import (
    CLAIM_GROUPS,
    NUMBER_CLAIMS,
    PRINTED_CLAIMS,
    effective_number,
    group_of,
)
from galloping.paper.unknowns import FIRST_READING, READINGS_BY_NAME, UNKNOWN_NAMES, UNKNOWNS

# relative evidence of a reading that is ruled out, and of a less probable one, powers of ten
MAX_RULED_OUT, MAX_UNLIKELY = -2.0, -1.0
MIN_VERDICT_MARGIN = 2.0  # standard errors from the evidence to the limits of a verdict
# effective settings of which one is expected below the interval
MIN_EFFECTIVE_SETTINGS = 1 / QUANTILES_90[0]
# ratio of a realisation to a printed number that agree, or of the ends of an interval that
# determines an unknown
MAX_AGREEMENT_RATIO = 1.5
# realisations that satisfy two claims that exclude each other, as share of the expected number
MAX_JOINT_SHARE = 1 / 4
MIN_EXPECTED_DRAWS = 10.0  # expected realisations for a verdict on a pair of claims
MAX_STEADY_CHANGE = 0.02  # relative amplitude change of a steady motion
MAX_ATTACK_ANGLE = 0.2  # rad: largest angle that satisfies the condition on it
ALL_NUMBERS = "all"  # name of the weights by all printed numbers


def paper_readings(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Compare interpretations of the reproduced paper's damaged text by their Bayesian evidence.

    The unknown numbers are integrated out. parts: rows of `trials.paper_inference.trial`, by names
    that begin with those of the trials. Returns one row per reading, all with the same effort:
    log10_bayes_factor, the logarithm of its evidence over that of the first reading, with
    standard_error; effective_settings; the factor by which it loses most against the first reading;
    its most probable setting.
    """
    rows = pd.concat([parts[name] for name in equal_effort(parts)])
    setting_rows, judged = (rows[rows["stage"] == stage] for stage in ("tried", "judged"))
    settings = dict(list(setting_rows.groupby("reading", sort=False)))
    evidence = {name: _log_evidence(rows) for name, rows in settings.items()}
    first, first_error = evidence[FIRST_READING.name]
    factors = [name for name in setting_rows.columns if _is_factor(name)]
    table = []
    first_means = _posterior_means(settings[FIRST_READING.name], factors)
    for name in READINGS_BY_NAME:
        if name not in settings:
            continue
        group, (log_evidence, error) = settings[name], evidence[name]
        power = (log_evidence - first) / np.log(10)
        error = np.hypot(error, first_error * (name != FIRST_READING.name)) / np.log(10)
        losses = _posterior_means(group, factors) - first_means
        best = judged[judged["reading"] == name].nlargest(1, "log_likelihood").iloc[0]
        table.append({
            "reading": name, "changes": READINGS_BY_NAME[name].kind, "settings_tried": len(group),
            "settings_proposed": int(group["proposed"].sum()),
            "effective_settings": effective_number(_normalise_weights(group["log_weight"])),
            "log10_bayes_factor": power, "standard_error": error,
            "verdict": "first" if name == FIRST_READING.name else _judge_reading(power, error),
            "worst_claims": losses.idxmin() if losses.min() < 0 else "",
            "log10_likelihood_change": losses.min() / np.log(10),
            **{unknown: best[unknown] for unknown in UNKNOWN_NAMES},
            "log_likelihood": best["log_likelihood"], "attack_angle": best["attack"],
            "change_percent": 100 * best["change"],
        })  # fmt: skip
    return pd.DataFrame(table)


def _judge_reading(power: float, error: float) -> str:
    low, high = power - MIN_VERDICT_MARGIN * error, power + MIN_VERDICT_MARGIN * error
    if high < MAX_RULED_OUT:
        return "ruled out as tried"
    if high < MAX_UNLIKELY:
        return "less probable"
    return "as probable" if low > MAX_UNLIKELY else "undecided"


def _is_factor(name: str) -> bool:
    claims = {claim.name for claim in PRINTED_CLAIMS if claim.minus_level is not None}
    return name in claims or name.startswith("noise ") or name.endswith(" points")


def _log_evidence(settings: pd.DataFrame) -> tuple[float, float]:
    """Compute the logarithm of the mean evidence of the runs, and its standard error."""
    logs = settings["log_weight"].to_numpy(float)
    top = logs.max()
    weights = np.exp(logs - top)
    runs = settings.groupby("replicate")["proposed"].first()
    error = np.sqrt(np.sum(weights**2) / np.sum(weights) ** 2 - 1 / runs.sum())
    return float(top + np.log(weights.sum() / len(runs))), float(error)


def _normalise_weights(log_weights: pd.Series) -> np.ndarray:
    weights = np.exp(log_weights.to_numpy(float) - log_weights.max())
    return weights / weights.sum()


def _posterior_means(settings: pd.DataFrame, columns: list[str]) -> pd.Series:
    """Average the logarithms of the factors over the posterior."""
    weights = _normalise_weights(settings["log_weight"])
    return pd.Series(weights @ settings[columns].clip(lower=-30.0).to_numpy(float), columns)


def region_samples(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return posterior samples and weights of parameters that the reproduced paper does not state.

    They are the settings of the first reading, with their noise realisations. Columns: the
    unknowns; stage `tried` or `draw`; weight_all by all that is printed, and weight_NAME by all but
    one of `agreement.CLAIM_GROUPS`, each sums to 1 over the settings; for draws the value of each
    claim, with the weight of its setting shared among its draws.
    """
    rows = pd.concat(parts.values(), ignore_index=True)
    rows = rows[(rows["reading"] == FIRST_READING.name) & rows["stage"].isin(("tried", "draw"))]
    is_setting = rows["stage"] == "tried"
    rows = rows.assign(setting=is_setting.cumsum())
    settings = rows[is_setting].set_index("setting")
    draws = rows[~is_setting].groupby("setting").size().reindex(settings.index)
    table = rows[["stage", "setting", *UNKNOWN_NAMES, *(claim.name for claim in PRINTED_CLAIMS)]]
    for group in (ALL_NUMBERS, *CLAIM_GROUPS):
        log_likelihood = (
            settings["log_likelihood"] if group == ALL_NUMBERS else settings[f"without_{group}"]
        )
        logs = settings["log_weight"] - settings["log_likelihood"] + log_likelihood
        weights = pd.Series(_normalise_weights(logs), settings.index)
        shared = rows["setting"].map(weights / draws)
        of_rows = np.where(is_setting, rows["setting"].map(weights), shared)
        table = table.assign(**{f"weight_{group}": of_rows})
    return table


def region_table(samples: pd.DataFrame, readings: pd.DataFrame) -> pd.DataFrame:
    """Tabulate posterior intervals of the parameters that the reproduced paper does not state.

    There is a row for each unknown, which says whether the printed numbers determine it. samples:
    of `region_samples`; readings: of `paper_readings`.
    """
    settings = samples[samples["stage"] == "tried"]
    effective = effective_number(settings[f"weight_{ALL_NUMBERS}"])
    best = settings.loc[settings[f"weight_{ALL_NUMBERS}"].idxmax()]
    table = []
    for unknown in UNKNOWNS:
        low, _, high = _weighted_quantiles(
            settings[unknown.name], settings[f"weight_{ALL_NUMBERS}"]
        )
        factor = high / low
        table.append({
            "unknown": unknown.name, "key": ".".join(unknown.path), "unit": unknown.unit,
            "best": best[unknown.name], "low": low, "high": high,
            "prior_low": unknown.low, "prior_high": unknown.high,
            "verdict": "left open" if factor >= MAX_AGREEMENT_RATIO
                       else "undecided" if effective < MIN_EFFECTIVE_SETTINGS else "determined",
            "why": f"the ends of the interval differ by a factor of {factor:.1f}, by "
                   f"{effective:.0f} effective settings",
        })  # fmt: skip
    others = readings[~readings["changes"].isin(("", "steadiness", "attack angle"))]
    for kind, of_kind in others.groupby("changes", sort=False):
        nearest = of_kind.sort_values("log10_bayes_factor", ascending=False).iloc[0]
        power = nearest["log10_bayes_factor"]
        ruled_out = (of_kind["verdict"] == "ruled out as tried").all()
        table.append({
            "unknown": kind, "verdict": "determined" if ruled_out else "left open",
            "reading": FIRST_READING.name if power < 0 else nearest["reading"],
            "why": f"next: {nearest['reading']}, 10^{power:.1f} times as probable",
        })  # fmt: skip
    numbers = f"{len(UNKNOWNS)} numbers and {others['changes'].nunique()} readings"
    n_others = len(PRINTED_CLAIMS) - len(NUMBER_CLAIMS)
    printed = f"{len(NUMBER_CLAIMS)} numbers and {n_others} bounds and words printed"
    table.append({"unknown": "all", "why": f"{numbers} are unknown, {printed}"})
    return pd.DataFrame(table)


def _weighted_quantiles(values: pd.Series, weights: pd.Series) -> np.ndarray:
    """Compute 5th, 50th and 95th percentile of weighted values."""
    return np.quantile(
        values, (QUANTILES_90[0], 0.5, QUANTILES_90[1]), weights=weights, method="inverted_cdf"
    )


def predictions(samples: pd.DataFrame) -> pd.DataFrame:
    """Compare each value in the reproduced paper with its posterior predictive distribution.

    It is predicted by draws, from all that is printed, and without its own group of printed values:
    the latter is a check of the model by numbers that it was not fitted to. For numbers: the 5th to
    95th percentile and the share of draws below the printed one; for bounds: the share of draws
    that satisfy them.

    samples: of `region_samples`.
    """
    draws, table = samples[samples["stage"] == "draw"], []
    settings = samples[samples["stage"] == "tried"]
    for claim in PRINTED_CLAIMS:
        group = group_of(claim)
        row = {"claim": claim.name, "group": group, "kind": claim.kind, "printed": claim.printed}
        values = draws[claim.name].to_numpy(float)
        for name, column in (("fitted", f"weight_{ALL_NUMBERS}"), ("predicted", f"weight_{group}")):
            weights = draws[column].to_numpy(float)
            effective = effective_number(settings[column])
            share = min(float(np.sum(weights * claim.is_met(values))), 1.0)  # but for rounding
            row |= {
                f"{name}_share": share,
                f"{name}_share_error": float(np.sqrt(share * (1 - share) / effective)),
                f"{name}_effective_settings": effective,
            }
            if claim.is_number:
                low, median, high = _weighted_quantiles(values, weights)
                row |= {f"{name}_median": median, f"{name}_low": low, f"{name}_high": high}
        table.append(row)
    return pd.DataFrame(table)


def exclusions(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Test, for each pair of values in the reproduced paper, if one simulation can match both.

    parts: rows of `trials.paper_inference`, of which the draws of all readings count, each a study
    of one draw. A draw has a number within a factor MAX_AGREEMENT_RATIO; `steady` and `attack
    angle` are conditions on the motion.
    """
    rows = pd.concat(parts.values(), ignore_index=True)
    draws = rows[rows["stage"] == "draw"]
    is_met = {
        "steady": (draws["change"] < MAX_STEADY_CHANGE).to_numpy(),
        "attack angle": (draws["attack"] <= MAX_ATTACK_ANGLE).to_numpy(),
    }
    for claim in PRINTED_CLAIMS:
        values = draws[claim.name].to_numpy(float)
        if claim.is_number:
            with np.errstate(divide="ignore"):
                distances = np.abs(np.log(values / claim.printed))
            is_met[claim.name] = distances < np.log(MAX_AGREEMENT_RATIO)
        else:
            is_met[claim.name] = claim.is_met(values)
    pairs = pd.DataFrame(list(combinations(is_met, 2)), columns=["claim", "other"])
    met = pd.DataFrame(is_met).astype(int)
    counts, both = met.sum(), met.T @ met
    table = pairs.assign(
        studies=len(draws),
        first=counts[pairs["claim"]].to_numpy(),
        second=counts[pairs["other"]].to_numpy(),
        both=[both.loc[pair] for pair in pairs.itertuples(index=False, name=None)],
    )
    chance = table["first"] * table["second"] / len(draws)
    ratio = table["both"] / chance.where(chance > 0)
    verdict = np.where(
        table["both"] < MAX_JOINT_SHARE * chance, "exclude each other", "go together"
    )
    verdict = np.where(chance < MIN_EXPECTED_DRAWS, "too few draws", verdict)
    table = table.assign(by_chance=chance, ratio=ratio, verdict=verdict)
    return table.sort_values(["verdict", "ratio"], kind="stable", ignore_index=True)
