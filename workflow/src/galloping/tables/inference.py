"""What the paper leaves out, as its printed numbers tell: readings, region, what excludes what."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import pandas as pd

from galloping.intervals import QUANTILES_90
from galloping.paper.unknowns import BASE, BY_NAME, CELLS, NUMBERS, PRINTED, UNKNOWNS, cell_name
from galloping.trials import paper_search
from galloping.trials.paper_search import STEADY

RULED_OUT, UNLIKELY = -2.0, -1.0  # powers of ten below the most probable reading
DETERMINED = 1 / 4  # of the range of an unknown: an interval that is shorter tells its size
NEAR = 1.5  # factor by which a draw may be off a printed number, to count as having it
EXCLUDING = 1 / 4  # of the draws that chance would give: fewer exclude each other
EXPECTED = 10.0  # draws by chance from which the share of those seen says anything
POWERS = np.log10(np.e)
PREDICTED, PREDICTING = 40, 16  # settings, and draws of each
# columns: by all numbers, by all but the errors of the amplitude
WITH, WITHOUT = "log_probability", "without_amplitudes"


def paper_readings(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Each reading of the paper at its most probable setting.

    parts: rows of `trials.paper_search`.
    """
    rows = pd.concat(parts.values(), ignore_index=True)
    best = rows[rows["stage"] == "best"].sort_values("height", ascending=False, kind="stable")
    best = best.groupby("variant", sort=False).head(1).set_index("variant")
    best = best.loc[[name for name in BY_NAME if name in best.index]]
    steady = [name for name in best.index if BY_NAME[name].steady]
    top = best.loc[best.loc[steady, WITH].idxmax()]
    tried = rows[rows["stage"].isin(("screened", "searched"))].groupby("variant").size()
    cells = [cell_name(cell) for cell in CELLS]
    power = POWERS * (best[WITH] - top[WITH])
    losses = POWERS * (best[cells] - top[cells]).astype(float)
    losses = losses.where(np.isfinite(power), np.inf)  # without a motion no cell tells
    least = losses.min(axis=1)
    verdict = np.where(power < UNLIKELY, "less probable", "probable")
    verdict = np.where(power < RULED_OUT, "ruled out", verdict)
    verdict = np.where(np.isfinite(power), verdict, "no motion")
    table = pd.DataFrame({
        "changes": [BY_NAME[name].kind for name in best.index], "settings_tried": tried,
        "power_of_ten": power, "verdict": verdict,
        "least": losses.idxmin(axis=1).where(least < 0, ""),
        "least_power_of_ten": least.replace(np.inf, np.nan),
        **{unknown.name: best[unknown.name] for unknown in UNKNOWNS},
        "change_percent": 100 * best["change"],
    }, index=best.index.rename("reading"))  # fmt: skip
    return table.reset_index()


def region_samples(parts: Mapping[str, pd.DataFrame], settings: Mapping) -> pd.DataFrame:
    """Settings as often as they are probable, by what is `known`: all numbers, or all but the
    amplitudes' errors, with what a draw at each of some of them gives for each printed number.

    parts: rows of `trials.paper_search.trial`. settings: seed.
    """
    rows = pd.concat(parts.values(), ignore_index=True)
    rows = rows[rows["variant"] == BASE.name]
    tables = []
    for column in (WITH, WITHOUT):
        drawn = paper_search.samples(rows, column, settings["seed"])
        some = drawn.head(PREDICTED)
        predicted = paper_search.predicted(BASE, some, PREDICTING, settings["seed"])
        drawn = drawn.assign(known=column, kind="setting")
        tables += [drawn, pd.DataFrame(predicted).assign(known=column, kind="draw")]
    return pd.concat(tables, ignore_index=True)


def region_table(samples: pd.DataFrame, readings: pd.DataFrame) -> pd.DataFrame:
    """One row for each unknown: what the printed numbers tell of it.

    samples: of `region_samples`; readings: of `paper_readings`.
    """
    drawn = samples[(samples["known"] == WITH) & (samples["kind"] == "setting")]
    best = readings.set_index("reading").loc[BASE.name]
    table = []
    for unknown in UNKNOWNS:
        low, high = drawn[unknown.name].quantile(QUANTILES_90)
        share = np.log(high / low) / np.log(unknown.high / unknown.low)
        table.append({
            "unknown": unknown.name, "key": ".".join(unknown.path), "unit": unknown.unit,
            "best": best[unknown.name], "low": low, "high": high,
            "least": unknown.low, "most": unknown.high,
            "verdict": "determined" if share < DETERMINED else "left open",
            "why": f"the interval spans {100 * share:.0f} % of the range, in equal ratios",
        })  # fmt: skip
    others = readings[(readings["changes"] != "") & (readings["changes"] != "steadiness")]
    for kind, of_kind in others.groupby("changes", sort=False):
        nearest = of_kind.sort_values("power_of_ten", ascending=False).iloc[0]
        power = nearest["power_of_ten"]
        table.append({
            "unknown": kind, "reading": nearest["reading"] if power > 0 else BASE.name,
            "verdict": "determined" if power < RULED_OUT else "left open",
            "why": f"next: {nearest['reading']}, 10^{power:.1f} times as probable",
        })  # fmt: skip
    numbers = f"{len(UNKNOWNS)} numbers and {others['changes'].nunique()} readings"
    printed = f"{len(NUMBERS)} numbers and {len(PRINTED) - len(NUMBERS)} bounds printed"
    table.append({"unknown": "all", "why": f"{numbers} are unknown, {printed}"})
    return pd.DataFrame(table)


def left_out(samples: pd.DataFrame) -> pd.DataFrame:
    """Each printed number beside what draws give in the region, inferred with and without the
    amplitudes' errors: without them these are predictions.

    samples: of `region_samples`.
    """
    drawn, table = samples[samples["kind"] == "draw"], []
    for claim in NUMBERS:
        row = {"claim": claim.name, "direction": claim.direction, "printed": claim.paper_value}
        for column, name in ((WITH, "all"), (WITHOUT, "without_amplitudes")):
            values = drawn.loc[drawn["known"] == column, claim.name].to_numpy(float)
            low, high = np.quantile(values, QUANTILES_90, method="nearest")  # some are infinite
            row |= {
                f"{name}_median": np.median(values),
                f"{name}_low": low,
                f"{name}_high": high,
                f"{name}_quantile": np.mean(values < claim.paper_value),
            }
        table.append(row)
    return pd.DataFrame(table)


def exclusions(parts: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Pair by pair, whether draws that have one of the printed numbers have the other.

    parts: rows of `trials.paper_search`, of which the draws of all readings count, each a study
    of one draw. A draw has a number within a factor NEAR; `steady` is the motion.
    """
    rows = pd.concat(parts.values(), ignore_index=True)
    drawn = rows[rows["stage"] == "draw"]
    held = {"steady": (drawn["change"] < STEADY).to_numpy()}
    for claim in PRINTED:
        values = drawn[claim.name].to_numpy(float)
        if claim.is_number:
            with np.errstate(divide="ignore"):
                held[claim.name] = np.abs(np.log(values / claim.paper_value)) < np.log(NEAR)
        else:
            held[claim.name] = claim.met(values)
    pairs = pd.DataFrame(list(combinations(held, 2)), columns=["claim", "other"])
    kept = pd.DataFrame(held).astype(int)
    counts, both = kept.sum(), kept.T @ kept
    table = pairs.assign(
        studies=len(drawn),
        first=counts[pairs["claim"]].to_numpy(),
        second=counts[pairs["other"]].to_numpy(),
        both=[both.loc[pair] for pair in pairs.itertuples(index=False, name=None)],
    )
    chance = table["first"] * table["second"] / len(drawn)
    ratio = table["both"] / chance.where(chance > 0)
    verdict = np.where(table["both"] < EXCLUDING * chance, "exclude each other", "go together")
    verdict = np.where(chance < EXPECTED, "too few draws", verdict)
    table = table.assign(by_chance=chance, ratio=ratio, verdict=verdict)
    return table.sort_values(["verdict", "ratio"], kind="stable", ignore_index=True)
