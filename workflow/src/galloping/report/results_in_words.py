"""Sentences on results beyond the paper; every number is read from tables of the study."""

from collections.abc import Mapping
from math import floor, isfinite
from types import MappingProxyType

import numpy as np
import pandas as pd

from galloping.paper.unknowns import UNKNOWN_LABELS
from galloping.recording.measurement import DEVIATION_UNIT
from galloping.results import BOUND, MAIN_METHOD, PAPER_METHOD
from galloping.tables.scores import CHOSEN_SETTING

NO_LABELS: Mapping[str, str] = MappingProxyType({})
NOISE_LEVEL = 0.05  # level that sentences describe, or the nearest level of the study


def on_methods(
    tables: Mapping[str, pd.DataFrame],
    case: str,
    protocol: str,
    noise_unit: str,
    labels: Mapping[str, str] = NO_LABELS,
) -> list[str]:
    """Write the report's sentences on how well the methods identify models, from result tables.

    tables: those of the study by name, of which it may lack any. case: the line of the sentences.
    protocol: that of its sensors. noise_unit: of the noise levels of these. labels: of methods. A
    sentence whose rows are missing is left out.
    """
    cell = {"case": case, "protocol": protocol, "noise_unit": noise_unit}
    sentences: list[str] = []
    if {"efficiency", "peers"} <= set(tables):
        efficiency = tables["efficiency"]
        sentences.append(_describe_accuracy(efficiency, tables["peers"], labels, **cell))
        sentences.append(_describe_data(efficiency, **cell))
    if "noise_r2" in tables:
        sentences.append(_describe_reconstruction(tables["noise_r2"], **cell))
    if "identifiability" in tables:
        table = tables["identifiability"]
        sentences.append(_describe_identifiability(table, protocol, noise_unit))
    if "trust" in tables:
        sentences += verdicts(tables["trust"])
    return list(filter(None, sentences))


def on_engineering(
    tables: Mapping[str, pd.DataFrame], case: str, protocol: str, **_: str
) -> list[str]:
    """Write the report's sentences on the galloping of an overhead line, from tables of results.

    Parameters are as in `on_methods`; the unit of the noise is not needed.
    """
    sentences: list[str] = []
    if {"limit_cycles", "bifurcations"} <= set(tables):
        sentences.append(_describe_galloping(tables["limit_cycles"], tables["bifurcations"], case))
    if "limit_cycle_ahead" in tables:
        sentences.append(_describe_prediction(tables["limit_cycle_ahead"], case, protocol))
    if "reduction" in tables:
        sentences.append(_describe_reduction(tables["reduction"], case))
    return list(filter(None, sentences))


def verdicts(trust: pd.DataFrame) -> list[str]:
    """Write a sentence for each group of fits: how often models with status `ok` were wrong.

    trust: trust.csv.
    """
    groups = trust[~trust["case"].str.startswith("every t")]  # rows that are a part of others
    sentences = []
    for group, rows in groups.groupby("group", sort=False):
        fits, sure, wrong = (int(rows[name].sum()) for name in ("fits", "ok", "ok_and_wrong"))
        refused = int(rows["refused"].sum())
        sentences.append(
            f"{sure:,} of {fits:,} fits to {group} were ok, {wrong:,} of these were wrong "
            f"({100 * wrong / fits:.3g} % of all), and {refused:,} were refused."
        )
    return sentences


def inferred(region: pd.DataFrame) -> list[str]:
    """Describe as text which parameters that the reproduced paper omits follow from its results.

    region: paper_region.csv.
    """
    determined, undecided, left_open = (
        ", ".join(
            UNKNOWN_LABELS.get(name, name)
            for name in region[region["verdict"] == verdict]["unknown"]
        )
        or "nothing"
        for verdict in ("determined", "undecided", "left open")
    )
    return [
        f"The paper's printed numbers determine: {determined}. They leave open: {left_open}. "
        f"Undecided, because too few settings have weight: {undecided}."
    ]


def _describe_noise(level: float, unit: str) -> str:
    return f"{100 * level:g} % noise" if unit == DEVIATION_UNIT else f"noise of {level:g} {unit}"


def _select_single_recordings(efficiency: pd.DataFrame, case: str, protocol: str) -> pd.DataFrame:
    """Select the rows of our method that have one recording in each noise realisation."""
    own = (efficiency["case"] == case) & (efficiency["protocol"] == protocol)
    return efficiency[own & (efficiency["method"] == MAIN_METHOD) & (efficiency["recordings"] == 1)]


def _describe_accuracy(
    efficiency: pd.DataFrame, peers: pd.DataFrame, labels: Mapping[str, str],
    case: str, protocol: str, noise_unit: str,
) -> str:  # fmt: skip
    rows = _select_single_recordings(efficiency, case, protocol)
    rows = _select_level(rows[rows["points"] == rows["points"].max()])
    if rows.empty:
        return ""
    row = rows.iloc[0]
    is_cell = (peers["case"] == case) & (peers["protocol"] == protocol)
    is_cell &= (peers["level"] == row["level"]) & (peers["setting"] == CHOSEN_SETTING)
    medians = peers[is_cell].set_index("method")["mean_error_percent"].dropna()
    if MAIN_METHOD not in medians:  # a continuous line has no true coefficients
        return ""
    text = (
        f"From {protocol} measurements of {_case_in_words(case)} with "
        f"{_describe_noise(row['level'], noise_unit)}, maximum likelihood finds exactly the true "
        f"terms in {row['exact_support']:g} of {row['replicates']:g} recordings, with a mean "
        f"coefficient error of {medians[MAIN_METHOD]:.2g} %"
    )
    others = medians.drop([MAIN_METHOD, BOUND, "weak_gls"], errors="ignore")
    if len(others):
        best = others.idxmin()
        text += f", against {others[best]:.2g} % by {labels.get(best, best)}"
    if isfinite(row["efficiency"]):
        text += f"; its error is {row['efficiency']:.2f} times the Cramér-Rao bound"
    return f"{text}."


def _describe_data(efficiency: pd.DataFrame, case: str, protocol: str, noise_unit: str) -> str:
    """Describe up to which noise, and from how few samples, the true terms are found.

    Levels count up to the first at which they are not, and numbers of samples down to it.
    """
    rows = _select_single_recordings(efficiency, case, protocol)
    rows = rows[rows["level"] > 0]
    rows = rows.assign(holds=rows["exact_support"] >= 0.95 * rows["replicates"])
    is_whole = rows["points"] == rows["points"].max()
    whole, parts = rows[is_whole].sort_values("level"), rows[~is_whole]
    whole = whole[whole["holds"].cummin()]
    if whole.empty:
        return ""
    parts = parts.sort_values("points", ascending=False)
    fewest = pd.concat([whole, parts[parts["holds"].cummin()]])["points"].min()
    return (
        f"It finds the true terms in at least 95 % of the recordings up to "
        f"{_describe_noise(whole['level'].max(), noise_unit)} and down to {fewest:,} samples."
    )


def _describe_galloping(cycles: pd.DataFrame, bifurcations: pd.DataFrame, case: str) -> str:
    if cycles.empty or bifurcations.empty:  # of a study without sweeps: they have no parameter
        return ""
    along = (bifurcations["case"] == case) & (bifurcations["parameter"] == "wind_speed")
    onset = bifurcations[along & (bifurcations["name"] == "Hopf")]["value"]
    steady = cycles[(cycles["case"] == case) & (cycles["parameter"] == "wind_speed")]
    steady = steady[steady["stable"].astype(str) == "True"]
    if onset.empty or steady.empty:
        return ""
    strongest = steady.loc[steady["value"].idxmax()]
    return (
        f"{_case_in_words(case).capitalize()} gallops from a wind of {onset.min():.2f} m/s. Up to "
        f"{strongest['value']:.3g} m/s it settles to a limit cycle, there with amplitudes of "
        f"{strongest['vertical_amplitude_m']:.2f} m (vertical) and "
        f"{strongest['horizontal_amplitude_m']:.2f} m (horizontal)."
    )


def _select_level(table: pd.DataFrame) -> pd.DataFrame:
    """Select the rows at the noise level of the sentences."""
    levels = table.loc[table["level"] > 0, "level"]
    if levels.empty:
        return table[:0]
    return table[table["level"] == levels.loc[(levels - NOISE_LEVEL).abs().idxmin()]]


def _describe_reconstruction(r2: pd.DataFrame, case: str, protocol: str, noise_unit: str) -> str:
    rows = r2[(r2["case"] == case) & (r2["protocol"] == protocol) & (r2["level"] > 0)]
    worst = rows.groupby(["method", "level"])["r2_median"].min().unstack("level")
    if MAIN_METHOD not in worst.index:
        return ""
    medians = worst.loc[MAIN_METHOD]
    # levels below the first at which most fits have no model
    medians = medians[np.isfinite(medians).cummin()]
    if medians.empty:
        return ""
    text = (
        f"Reconstructions by maximum likelihood have a median R² of at least "
        f"{_round_down(medians.min())} in both directions up to "
        f"{_describe_noise(medians.index.max(), noise_unit)}"
    )
    if PAPER_METHOD in worst.index:
        paper = _round_down(worst.loc[PAPER_METHOD, medians.index].min())
        text += f", against {paper} by the paper's method from the same sensors"
    return f"{text}."


def _round_down(r2: float) -> str:
    """Format R2 with four decimals, rounded down if it is below 1."""
    return f"{floor(1e4 * r2) / 1e4:.4f}".replace("-", "\N{MINUS SIGN}") if isfinite(r2) else "none"


def _describe_identifiability(table: pd.DataFrame, protocol: str, noise_unit: str) -> str:
    rows = table[table["protocol"] == protocol]
    bounded = _select_level(rows[rows["coefficient_over_bound"].notna()])
    rows = rows[rows["level"].isin(bounded["level"]) & (rows["points"] == bounded["points"].max())]
    texts = []
    for (case, recordings), group in rows.groupby(["case", "recordings"], sort=False):
        known = (group["verdict"] == "identifiable").sum()
        text = f"{known} of {len(group)} terms of {_case_in_words(case)}"
        texts.append(text + (f" from {recordings} recordings together" if recordings > 1 else ""))
    if not texts:
        return ""
    return (
        f"By the Cramér-Rao bound, at {_describe_noise(rows['level'].iloc[0], noise_unit)} an "
        f"unbiased method can identify {', '.join(texts)}."
    )


def _describe_prediction(table: pd.DataFrame, case: str, protocol: str) -> str:
    rows = _select_level(table[(table["case"] == case) & (table["protocol"] == protocol)])
    rows = rows.dropna(subset=["recorded_m", "true_m", "predicted_m"])
    if rows.empty:
        return ""
    texts = [
        f"{row['state']}: {row['recorded_m']:.3f} m recorded, {row['true_m']:.3f} m on the limit "
        f"cycle, {row['predicted_m']:.3f} m ({row['low_m']:.3f} to {row['high_m']:.3f}) predicted"
        for row in rows.to_dict("records")
    ]
    return (
        f"A model identified from the record of {_case_in_words(case)} predicts the limit cycle to "
        f"which the motion goes on. Amplitudes of {'; '.join(texts)}."
    )


def _describe_reduction(table: pd.DataFrame, case: str) -> str:
    rows = table[table["direction"] == "vertical"].set_index("line")
    vertical = rows["amplitude_m"]
    if "two modes" not in vertical:
        return ""
    # the amplitude of a motion that dies out is that of one moment of its decay
    if rows["limit_cycle_m"]["two modes"] < 0.5 * vertical["two modes"]:
        return ""
    changes = 100 * (vertical.drop("two modes") / vertical["two modes"] - 1).dropna()
    if changes.empty:
        return ""
    small = changes.abs() < 1
    texts = [f"{change:+.0f} % ({line})" for line, change in changes[~small].items()]
    texts = [text.replace("-", "\N{MINUS SIGN}", 1) for text in texts]
    if small.any():
        texts.append(f"less than 1 % ({', '.join(changes.index[small])})")
    return (
        f"What the two-mode model of {_case_in_words(case)} leaves out changes the vertical "
        f"amplitude over 200 to 300 s: {', '.join(texts)}."
    )


def _case_in_words(case: str) -> str:
    return f"the {case.replace('_', '-')} line"
