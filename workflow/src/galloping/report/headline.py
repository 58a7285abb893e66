"""What was found, in sentences whose every number is read from the study's tables."""

import pandas as pd

from galloping.names import OURS


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
    sentences = [
        _from_sensors(efficiency, errors, case, protocol),
        _least_data(efficiency, case, protocol),
        _galloping(cycles, bifurcations, case),
    ]
    return [sentence for sentence in sentences if sentence]


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
