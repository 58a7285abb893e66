"""What was found, in sentences and rows whose every number is read from the study's tables."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.paper.claims import AT_LEAST, CLAIMS, HELD
from galloping.results import OURS


def headline(
    efficiency: pd.DataFrame,
    errors: pd.DataFrame,
    cycles: pd.DataFrame,
    bifurcations: pd.DataFrame,
    *,
    case: str,
    protocol: str,
) -> list[str]:
    """Sentences on identification from sensors and on the galloping itself.

    efficiency, errors, cycles, bifurcations: efficiency.csv, noise_coefficients.csv,
    limit_cycles.csv and bifurcations.csv. case: the line that the sentences are about. protocol:
    that of its sensors. A sentence whose rows the study does not have is left out.
    """
    sentences = (
        _from_sensors(efficiency, errors, case, protocol),
        _least_data(efficiency, case, protocol),
        _galloping(cycles, bifurcations, case),
    )
    return list(filter(None, sentences))


def verdicts(trust: pd.DataFrame) -> list[str]:
    """A sentence on each group of fits in trust.csv: how often a verdict was sure and wrong."""
    own = trust[~trust["case"].str.startswith("every t")]  # rows that are a part of others
    sentences = []
    for group, rows in own.groupby("group", sort=False):
        fits, sure, wrong = (int(rows[name].sum()) for name in ("fits", "ok", "ok_and_wrong"))
        refused = int(rows["refused"].sum())
        sentences.append(
            f"Of {fits:,} fits to {group}, {sure:,} were ok, {wrong:,} of them wrong "
            f"({100 * wrong / fits:.2g} % of all), and {refused:,} were refused."
        )
    return sentences


def inferred(region: pd.DataFrame) -> list[str]:
    """A sentence on what the paper's numbers tell of what it leaves out, of paper_region.csv."""
    named = {
        verdict: ", ".join(name.replace("_", " ") for name in of["unknown"])
        for verdict, of in region.groupby("verdict")
    }
    told, left = (named.get(name, "nothing") for name in ("determined", "left open"))
    return [f"The paper's printed numbers determine: {told}. They leave open: {left}."]


def _from_sensors(efficiency: pd.DataFrame, errors: pd.DataFrame, case: str, protocol: str) -> str:
    rows = efficiency[(efficiency["case"] == case) & (efficiency["protocol"] == protocol)]
    rows = rows[(rows["method"] == OURS) & (rows["points"] == rows["points"].max())]
    rows = rows[rows["level"] > 0].sort_values("level")
    if rows.empty:
        return ""
    row = rows.iloc[(rows["level"] - 0.05).abs().argmin()]
    at = (errors["case"] == case) & (errors["protocol"] == protocol)
    at &= errors["level"] == row["level"]
    medians = errors[at].groupby("method")["mean_error_percent"].mean().dropna()
    if OURS not in medians:  # a continuous line has no true coefficients
        return ""
    peers = medians.drop([OURS, "bound", "weak_gls"], errors="ignore")
    beside = f", against {peers.min():.2g} % by {peers.idxmin()}" if len(peers) else ""
    return (
        f"From {protocol} measurements of {case} with {100 * row['level']:g} % noise, maximum "
        f"likelihood finds exactly the true terms in {row['exact_support']} of "
        f"{row['replicates']} recordings, with a mean coefficient error of "
        f"{medians[OURS]:.2g} %{beside}; its error is {row['efficiency']:.2f} times the "
        f"Cramér-Rao bound."
    )


def _least_data(efficiency: pd.DataFrame, case: str, protocol: str) -> str:
    rows = efficiency[(efficiency["case"] == case) & (efficiency["protocol"] == protocol)]
    rows = rows[(rows["method"] == OURS) & (rows["exact_support"] >= 0.95 * rows["replicates"])]
    noisy = rows[rows["level"] > 0]
    if noisy.empty:
        return ""
    highest, fewest = noisy["level"].max(), noisy["points"].min()
    return (
        f"It finds the true terms in at least 95 % of the recordings up to {100 * highest:g} % "
        f"noise and down to {fewest:,} samples."
    )


def _galloping(cycles: pd.DataFrame, bifurcations: pd.DataFrame, case: str) -> str:
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
        f"{case} gallops from a wind of {onset.min():.2f} m/s on; up to "
        f"{strongest['value']:.3g} m/s it settles to a limit cycle, there with half ranges of "
        f"{strongest['v_m']:.2f} m (vertical) and {strongest['w_m']:.2f} m (horizontal)."
    )


# --- the paper's printed numbers beside ours, and what holds ---


STATES = {"vertical": "q_v", "horizontal": "q_w"}
SIGNS = {"value": "", AT_LEAST: "≥ ", "at_most": "≤ "}
ABSTRACT = "(first abstract)"  # bounds that the text itself replaces by stricter ones


@dataclass(frozen=True)
class PaperCell:
    """One printed number or bound beside ours. verdict: as of `galloping.paper.claims`."""

    printed: str
    ours: str
    verdict: str
    reason: str

    @property
    def holds(self) -> bool:
        return self.verdict in HELD


def section(paper: pd.DataFrame, varied: pd.DataFrame | None) -> dict:
    """What the page begins with, of paper.csv and of reproduction.csv, where the study has it.

    count: the sentence on how many claims hold. rows: the table. failures: a sentence for each
    claim that does not hold. by_settings: a sentence on settings that the paper does not print, or
    "".
    """
    return {
        "count": count(paper),
        "rows": rows(paper),
        "failures": unheld(paper),
        "by_settings": "" if varied is None else by_settings(varied),
    }


def count(paper: pd.DataFrame) -> str:
    """How many of the paper's claims hold, in one sentence; what is not judged, with the reason.

    paper: paper.csv.
    """
    single = paper[~paper["claim"].str.endswith("in the same draw")]
    judged = single[single["verdict"] != "not judged"]
    held = judged["verdict"].isin(HELD)
    numbers = Counter(judged["verdict"])
    run = len(single) - numbers["not run"]
    text = f"Of the paper's {len(single)} printed numbers and bounds {held.sum()} hold"
    text += f", of {run} that were run" * (run < len(single))
    kinds = ", ".join(f"{n} {verdict}" for verdict, n in numbers.items())
    text += f" ({kinds})." if kinds else "."
    for (case, reason), rows in single[single["verdict"] == "not judged"].groupby(
        ["case", "reason"], sort=False
    ):
        text += f" {len(rows)} about {case} are not judged: {reason}."
    return text


def rows(paper: pd.DataFrame) -> dict[str, list[PaperCell]]:
    """The table of the first screen, without the looser bounds of the first abstract: of each
    statement one cell of both directions together, or one of each.
    """
    first = next(iter(paper["case"]), "")
    printed = {claim.name: (SIGNS[claim.kind], claim.tolerance) for claim in CLAIMS}
    found: dict[str, list[PaperCell]] = {}
    for row in paper[~paper["claim"].str.endswith(ABSTRACT)].to_dict("records"):
        state = STATES.get(row["direction"])
        statement = row["claim"].replace(f" of {state}", "") if state else row["claim"]
        if row["case"] != first:
            statement += f" ({row['case'].replace('_', '-')})"
        found.setdefault(statement, []).append(_cell(row, *printed.get(row["claim"], ("", 0.0))))
    return found


def unheld(paper: pd.DataFrame) -> list[str]:
    """Each claim that was judged and does not hold, with the reason."""
    failed = paper[~paper["verdict"].isin([*HELD, "not run", "not judged"])]
    return [f"{row['claim']}: {row['verdict']}; {row['reason']}." for _, row in failed.iterrows()]


def by_settings(varied: pd.DataFrame) -> str:
    """What other values of settings that the paper leaves open would do to the claims.

    varied: reproduction.csv. Of each setting the value at which the fewest claims hold is named.
    """
    if varied.empty:
        return ""
    held = varied.groupby(["parameter", "value", "unit", "default"], sort=False)["held"]
    held = held.agg(["sum", "size"]).reset_index()
    own = held[held["default"]]
    others = held[~held["default"]]
    if others.empty:
        return ""
    worst = others.loc[others.groupby("parameter", sort=False)["sum"].idxmin()]
    examples = ", ".join(
        f"{row['sum']} at {row['parameter'].replace('_', ' ')} {row['value']:g}"
        + (f" {row['unit']}" if row["unit"] != "1" else "")
        for row in worst.sort_values("sum").to_dict("records")
    )
    of = f"{own['sum'].iloc[0]} at the study's settings; " if len(own) else ""
    return (
        "The paper leaves some settings open, and they decide what holds. Of "
        f"{others['size'].iloc[0]} claims about the first line hold {of}with one setting "
        f"changed, {examples}."
    )


def _cell(row: dict, sign: str, tolerance: float) -> PaperCell:
    printed = "" if pd.isna(row["printed"]) else f"{sign}{row['printed']:g}"
    printed += f", within {tolerance:g}" if tolerance else ""
    if row["verdict"] in ("not judged", "not run"):
        return PaperCell(printed, "", row["verdict"], row["reason"])
    if sign or not printed:
        share = f"{100 * row['share_of_draws']:.0f} %"
        ours = share if pd.isna(row["median"]) else f"{_number(row['median'])} ({share})"
    else:
        low, high = _number(row["low"]), _number(row["high"])
        ours = f"{_number(row['median'])} ({low} to {high})"
    return PaperCell(printed, ours, row["verdict"], row["reason"])


def _number(value: float) -> str:
    if not np.isfinite(value):
        return "no model" if pd.isna(value) else ("∞" if value > 0 else "−∞")
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.0e}"
