"""Numbers of the paper beside noise realisations of its method, and the settings they imply."""

import re
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from galloping.figures import parts, style
from galloping.paper.claims import CLAIMS_BY_NAME
from galloping.paper.unknowns import UNKNOWN_LABELS
from galloping.results import PAPER_METHOD

METHOD_COLOR = style.method_style(PAPER_METHOD).color  # colour of its realisations
MIN_EXPONENT = -12.0  # smallest plotted power of ten; less probable readings are plotted here
AXIS_EXPONENT = -6.0  # largest power of ten at the left end of the axis
RANGE_STYLE = {"color": style.LIGHT_GREY, "height": 0.55}


def draw_printed(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Plot the errors printed in the reproduced paper on top of their simulated ranges.

    The ranges are those of many noise realisations. A second panel shows the share of the
    realisations that satisfies each printed bound on R2. table: paper.csv. settings: case, that of
    the paper's numbers.
    """
    rows = table[(table["case"] == settings["case"]) & table["median"].notna()]
    rows = rows[rows["claim"].isin(CLAIMS_BY_NAME) & (rows["role"] == "counted")]
    numbers = rows[[CLAIMS_BY_NAME[name].is_number for name in rows["claim"]]]
    bounds = rows[[CLAIMS_BY_NAME[name].is_r2 for name in rows["claim"]]]
    if numbers.empty and bounds.empty:
        return parts.make_empty_figure("the paper's claims are not judged in this study")
    height = 0.85 + 0.185 * max(len(numbers), len(bounds))
    figure, ((left, right),) = parts.panels(height, 1, 2, width_ratios=(1.1, 1))
    parts.letter(left, 0, "errors that the paper prints")
    limits = 1e-2, 1e3
    left.set(xscale="log", xlim=(limits[0] / 1.5, limits[1] * 1.5), xlabel="error, %")
    left.set_xticks(ticks := 10.0 ** np.arange(-2, 4), [f"{tick:g}" for tick in ticks])
    for k, row in enumerate(numbers.itertuples()):
        bar = {"lw": 3.0, "alpha": 0.45}
        parts.dot(left, k, (row.median, row.low, row.high), limits, METHOD_COLOR, "o", 4, bar=bar)
        if row.high > limits[1]:
            left.plot(limits[1], k, ">", color=METHOD_COLOR, ms=4, clip_on=False)
        left.plot(row.printed, k, "*", color=style.PAPER_COLOR, ms=8, mew=0, zorder=5)
    parts.rows(left, list(map(_shorten_claim, numbers["claim"])), lines=False)
    parts.letter(right, 1, "share that meets a bound")
    columns = ["share_met", "share_met_low", "share_met_high"]
    shares, low, high = 100 * bounds[columns].to_numpy(float).T
    right.barh(np.arange(len(bounds)), shares, height=0.55, color=METHOD_COLOR, alpha=0.45)
    right.hlines(np.arange(len(bounds)), low, high, color=METHOD_COLOR, lw=1.0)
    for k, share in enumerate(shares):
        right.text(112, k, f"{share:.0f} %", va="center", ha="right", fontsize="small")
    right.axvline(50, color="#8a8a8a", lw=0.6, ls=":")
    right.set(xlim=(0, 112), xticks=[0, 25, 50, 75, 100], xlabel="share of the realisations, %")
    named = zip(bounds["claim"], bounds["printed"], strict=True)
    names = [name.replace("R2", f"R2 ≥ {bound:g}", 1) for name, bound in named]
    parts.rows(right, list(map(_shorten_claim, names)), lines=False)
    star = parts.key("printed in the paper", marker="*", color=style.PAPER_COLOR, ms=8, mew=0)
    ours = "our realisations: median, 5 to 95 %"
    dot = parts.key(ours, color=METHOD_COLOR, marker="o", ms=4, ls="-")
    share = parts.key("95 % interval of a share", color=METHOD_COLOR, ls="-", lw=1.0)
    parts.legend(figure, star, dot, share)
    if len(numbers) and len(bounds):
        inside = numbers["printed"].between(numbers["low"], numbers["high"]).sum()
        figure.set_label(
            f"{inside} of {len(numbers)} printed errors lie within the 5 to 95 % range; a bound on "
            f"R² is satisfied by {shares.min():.0f} to {shares.max():.0f} % of the realisations"
        )
    return figure


def _shorten_claim(name: str) -> str:
    name = name.replace("mean error of ", "").replace("amplitude error", "amplitude")
    return parts.typeset(name.replace(" (first abstract)", ", abstract"))


def draw_region(region: pd.DataFrame, readings: pd.DataFrame) -> Figure:
    """Plot the inferred ranges of the parameters that the reproduced paper does not state.

    A second panel shows the relative evidence of each interpretation of the paper's damaged text.
    region: paper_region.csv. readings: of `tables.inference.paper_readings`.
    """
    numbers = region[region["unknown"].isin(list(UNKNOWN_LABELS)) & region["low"].notna()]
    figure, ((left, right),) = parts.panels(0.9 + 0.2 * len(readings), 1, 2, width_ratios=(1, 1.3))
    parts.letter(left, 0, "unknown numbers, 5 to 95 %")
    ends = np.log(numbers[["prior_low", "low", "high", "prior_high"]].to_numpy(float)).T
    low, high = (100 * (each - ends[0]) / (ends[3] - ends[0]) for each in ends[1:3])
    places = np.arange(len(numbers))
    left.barh(places, 100, label="range tried", **RANGE_STYLE)
    left.barh(
        places, high - low, left=low, height=0.3, color=style.MODEL_COLOR, label="plausible range"
    )
    for y, row in enumerate(numbers.itertuples()):
        unit = "" if row.unit == "1" else f" {row.unit}"
        text = f"{row.low:.2g} to {row.high:.2g}{unit}"
        left.text(103, y, text, va="center", size="small")
    parts.rows(left, [UNKNOWN_LABELS[name] for name in numbers["unknown"]], lines=False)
    left.set(xlim=(0, 165), xticks=[0, 50, 100], xlabel="% of the range tried, logarithmic")
    parts.letter(right, 1, "readings of the paper")
    powers = np.maximum(readings["log10_bayes_factor"].to_numpy(float), MIN_EXPONENT)
    right.axvline(0, color=style.DARK_GREY, lw=0.6)
    right.errorbar(powers, np.arange(len(readings)), xerr=2 * readings["standard_error"], fmt="o",
                   ms=3.5, color=style.MODEL_COLOR, elinewidth=1.0)  # fmt: skip
    for k, row in enumerate(readings.itertuples()):
        end = powers[k] + 2 * row.standard_error
        right.text(end + 0.15, k, row.verdict, va="center", size="small",
                   bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5})  # fmt: skip
    parts.rows(right, list(map(_typeset_reading, readings["reading"])), lines=False)
    right.set(xlim=(min(AXIS_EXPONENT, powers.min() - 1), max(2.0, powers.max() + 4.0)),
              xlabel="$\\log_{10}$ of the relative evidence")  # fmt: skip
    parts.legend(figure)
    determined = (numbers["verdict"] == "determined").sum()
    figure.set_label(
        f"The printed numbers determine {determined} of {len(numbers)} unknown numbers"
    )
    return figure


def _typeset_reading(reading: str) -> str:
    """Typeset the coefficients in the name of a reading: `beta2 minus 0.1` as beta_2 -0.1."""
    return re.sub(r"\b(beta|eta)(\d)", r"$\\\1_\2$", reading.replace("minus ", "\N{MINUS SIGN}"))
