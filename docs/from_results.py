"""Tables of the pages that are computed from `results/reference`: `make docs` writes them again.

A page marks the place of a table by a pair of comments; `BLOCKS` names the function that makes it.
"""

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from scipy.optimize import brentq

import galloping
from galloping.configuration.load import load, plain
from galloping.line.galerkin import coefficients
from galloping.line.galerkin import make_model as equations_of

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = ROOT / "results" / "reference"
BLOCK = re.compile(r"(<!-- made from results: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
SURE_CASE = "every t > 9"  # of `tables.trial_summaries.trust`
OURS, FREE_DECAY = "maximum_likelihood", "free decay with a second mode"

# Titles of columns, then rows of cells.
Table = Iterator[tuple[str, ...]]


def table_of(name: str) -> pd.DataFrame:
    return pd.read_csv(REFERENCE / f"{name}.csv")


def percent(part: float, whole: float) -> str:
    return f"{part:,} of {whole:,} ({100 * part / whole:.1f} %)"


# --- trials of the verdicts: make trust ---


def claims() -> Table:
    """Return what is claimed of the statuses, the aim, and what was found."""
    found = table_of("trust/trust")
    group = found.groupby("group")
    lines = group.get_group("random lines").set_index("case")
    every, sure = lines.loc["all"], lines.loc[SURE_CASE]
    known = group.get_group("default line")
    faults = group.get_group("sensor faults").set_index("case").drop("none")
    steady = group.get_group("long and steady").set_index("case")
    cycles = steady[steady.index.str.contains("cycle")]
    long, wild = steady[steady.index.str.endswith(" s")], steady.loc["sensitive lines"]
    named, coverage = faults["fault_diagnosed"], every["coverage_unconditional"]
    counts = ["replicates", "exact_support", "ok_and_wrong"]
    systems = table_of("trust/systems").groupby("method")[counts].sum()
    best = systems["exact_support"].drop(OURS)
    yield "Claim", "Aim", "Found", "Result"
    for claim, aim, shown, is_met in (
        ("lines with random parameters, 5 % noise: models that are `ok` and wrong", "at most 2 %",
         f"{percent(every['ok_and_wrong'], every['fits'])}; {every['ok']:,.0f} of all are `ok`",
         every["ok_and_wrong"] <= 0.02 * every["fits"]),
        ("lines with random parameters, *t* > 9 for every term: models that are `ok`",
         "at least 95 %",
         percent(sure["ok"], sure["fits"]), sure["ok"] >= 0.95 * sure["fits"]),
        ("lines with random parameters, 5 % noise: true coefficients inside their 95 % intervals",
         "93 to 98 %", f"{100 * coverage:.1f} %", 0.93 <= coverage <= 0.98),
        ("default line, 5 to 15 % noise: exact", "all",
         percent(known["exact_support"].sum(), known["fits"].sum()),
         known["exact_support"].sum() == known["fits"].sum()),
        ("faults and disturbances: `ok` and wrong", "at most 1 of 20 for each fault",
         f"at most {faults['ok_and_wrong'].max()} of {faults['fits'].max()}",
         faults["ok_and_wrong"].max() <= 1),
        ("faults and disturbances: named in the reason", "at least 15 of 20 for each fault",
         f"at least {named.min():.0f} of {faults['fits'].min()} (fewest: {named.idxmin()})",
         named.min() >= 15),
        (f"{table_of('trust/systems')['system'].nunique()} published systems, 1 to 20 % noise: "
         "exact", "`maximum_likelihood` finds more than `weak_gls` and pysindy's weak form",
         f"{percent(systems.loc[OURS, 'exact_support'], systems.loc[OURS, 'replicates'])}; "
         f"`weak_gls` {best['weak_gls']}, weak form {best['weak']}",
         systems.loc[OURS, "exact_support"] > best.max()),
        ("these systems: models that are `ok` and wrong", "at most 2 %",
         percent(systems.loc[OURS, "ok_and_wrong"], systems.loc[OURS, "replicates"]),
         systems.loc[OURS, "ok_and_wrong"] <= 0.02 * systems.loc[OURS, "replicates"]),
        ("recordings of 2,000 to 100,000 s: exact and `ok`", "all",
         percent(long[["exact_support", "ok"]].min(axis=1).sum(), long["fits"].sum()),
         long[["exact_support", "ok"]].min(axis=1).sum() == long["fits"].sum()),
        ("chaotic or very sensitive lines", "none `refused`, none `ok` and wrong",
         f"{wild['refused']} `refused`, {wild['ok']} of {wild['fits']} `ok`, "
         f"{wild['ok_and_wrong']} wrong", wild["refused"] == wild["ok_and_wrong"] == 0),
        ("limit cycles alone", "no `ok`",
         f"{cycles['ok'].sum()} of {cycles['fits'].sum()} `ok`", cycles["ok"].sum() == 0),
    ):  # fmt: skip
        yield claim, aim, shown, "met" if is_met else "**not met**"


def statuses_of_groups() -> Table:
    """How often each status was given, and how often it was right."""
    yield ("Recordings", "Noise", "Number", "Exact", "`ok`", "`ok` and wrong", "`not identifiable`",
           "`approximate`", "`refused`", "Inside intervals")  # fmt: skip
    counts = [
        "fits", "exact_support", "ok", "ok_and_wrong", "not_identifiable", "approximate", "refused",
    ]  # fmt: skip
    rows = table_of("trust/trust")
    of_fault = rows["group"] == "sensor faults"
    rows["case"] = rows["case"].where(~(of_fault & (rows["case"] == "none")), "no fault")
    for row in rows.to_dict("records"):
        case = row["protocol"] if row["group"] == "default line" else row["case"]
        group = row["group"].replace("sensor faults", "faults, disturbances")
        share = row["coverage_unconditional"]
        held = "" if pd.isna(share) else f"{100 * share:.0f} %"
        yield (f"{group}: {case}", f"{100 * row['level']:.0f} %",
               *(f"{row[each]:,}" for each in counts), held)  # fmt: skip


# --- lines that are not their own model: make reality ---


def models_of_real_lines() -> Table:
    """Errors of models of lines that no library contains, median and worst."""
    found = table_of("reality/model_error")
    yield "Line", "Sensors", "Amplitudes", "Net damping", "Frequencies", "95 % intervals"
    ours = (found["method"] == OURS) & (found["truth"] != FREE_DECAY)
    for row in found[ours].to_dict("records"):
        cells = []
        for what in ("amplitude", "damping", "frequency"):
            errors, worst = (
                [row[f"{what}_{direction}_{kind}_percent"] for direction in "vw"]
                for kind in ("error", "worst")
            )
            none = pd.isna(errors).any()
            largest = "" if none else f"{float(format(max(worst), '.2g')):g}"
            cells.append("no cycle" if none else f"{max(errors):.2g} % ({largest})")
        covered = f"{row['coverage_95_percent']:.0f} %"
        line = row["truth"].removesuffix(f", {row['sensors']}")
        yield line, row["sensors"], *cells, covered


def free_decays() -> Table:
    """Errors of frequency and damping of random free decays, median and worst."""
    found = table_of("reality/model_error")
    yield "Sensor", "Recordings", "With a model", "Net damping", "Frequency", "95 % intervals"
    for row in found[found["truth"] == FREE_DECAY].to_dict("records"):
        errors = [
            f"{row[f'{what}_v_error_percent']:.2g} % ({row[f'{what}_v_worst_percent']:.2g})"
            for what in ("damping", "frequency")
        ]
        counts = [f"{row[each]:g}" for each in ("replicates", "n_models")]
        yield row["sensors"], *counts, *errors, f"{row['coverage_95_percent']:.0f} %"


# --- settings of published methods: make published ---


def exact_terms() -> Table:
    """Shares of recordings of Lorenz's system with exactly the right terms, beside others."""
    found = table_of("published/published_terms")
    lorenz = found[found["system"] == "lorenz"]
    level, duration = lorenz["level"], lorenz["duration"]
    few = level.isin([0.1, 0.2, 0.3, 0.4]) & duration.isin([4, 7, 10])
    yield "Exact terms, %", f"`{OURS}`", "ODR-BINDy", "JSINDy", "ensemble weak SINDy"
    for name, cells in (
        (f"mean of all {len(lorenz)} cells: noise 2.5 to 40 %, 4 to 10 s", lorenz),
        ("noise 10, 20, 30, 40 % and 4, 7, 10 s", lorenz[few]),
        ("noise up to 12.5 %", lorenz[level <= 0.125]),
        ("noise from 22.5 %", lorenz[level >= 0.225]),
        ("4 s", lorenz[duration == 4]),
        ("10 s", lorenz[duration == 10]),
    ):
        shares = cells[["share_exact_support", "odr_bindy", "jsindy", "ensemble_weak_sindy"]].mean()
        yield name, *(f"{100 * share:.1f}" for share in shares)


def published_statuses() -> Table:
    """Exact, `ok` and wrong models of the published settings, by system."""
    found = table_of("published/published_terms")
    found["models"] = (found["share_exact_support"] * found["fits"]).round().astype(int)
    yield "System", "Recordings", "Exact", "`ok`", "`ok` and wrong"
    names = {"lorenz": "Lorenz", "rossler": "Rössler", "van_der_pol": "van der Pol"}
    for name, rows in found.groupby("system"):
        sums = rows[["fits", "models", "ok", "ok_and_wrong"]].sum()
        yield names[name], *(f"{each:,}" for each in sums)


def weak_term() -> Table:
    """How often one small quadratic term is found, and how often its interval is right."""
    found = table_of("published/published_intervals")
    yield ("True coefficient", "Samples", "Found, %", "Naive selection, %", "PSI-SINDy, %",
           "Inside its 95 % interval, %")  # fmt: skip
    for row in found.to_dict("records"):
        published, naive = (
            row["share_with_term_published"],
            [row[f"share_with_term_naive_{e}"] for e in ("low", "high")],
        )
        yield (row["case"].split()[1], f"{row['samples']:,}",
               f"{100 * row['share_with_term']:.1f}",
               "" if pd.isna(naive).any() else " to ".join(f"{100 * each:.1f}" for each in naive),
               "" if pd.isna(published) else f"{100 * published:.1f}",
               f"{100 * row['coverage']:.1f}")  # fmt: skip


# --- the study ---


def lines_of_study() -> Table:
    """Onset and largest attack angle of the lines of `config/config.yaml`."""
    settings = load(yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8")))
    time = np.arange(0.0, settings.simulation.duration, 1.0 / settings.simulation.sampling_rate)
    yield "Line", "Wind, m/s", "Galloping begins at, m/s", "Largest attack angle, rad", "in degrees"
    for name, case in plain(settings)["cases"].items():

        def growth(speed: float, case: dict = case) -> float:
            model = equations_of(coefficients(case | {"wind": case["wind"] | {"speed": speed}}))
            return np.linalg.eigvals(model.jacobian(np.zeros((1, 4)))[0]).real.max()

        speed, model = case["wind"]["speed"], equations_of(coefficients(case))
        start = [case["initial_state"][state] for state in model.states]
        motion = galloping.simulate(model, start, time)
        angle = np.abs(motion.states[:, 2]).max() / speed
        onset = brentq(growth, 0.1, speed, xtol=1e-6)
        yield (name.replace("_", "-"), f"{speed:g}", f"{onset:.2f}", f"{angle:.3f}",
               f"{np.degrees(angle):.1f}")  # fmt: skip


def two_modes() -> Table:
    """Limit cycle and frequency of lines that move in more than two modes, against two modes."""
    found = table_of("reduction")
    rows = found.pivot(index="line", columns="direction")
    yield ("Line", "Vertical amplitude, m", "Error of two modes, %",
           "Horizontal amplitude, m", "Error of two modes, %")  # fmt: skip
    for line in found["line"].unique():
        of = rows.loc[line]
        cells = [
            "" if pd.isna(of[column, direction]) else f"{of[column, direction]:.{digits}f}"
            for direction in ("vertical", "horizontal")
            for column, digits in (("limit_cycle_m", 3), ("limit_cycle_error_percent", 1))
        ]
        yield re.sub(r"^(\d+) (modes?)$", r"\1 sine \2", line), *cells


BLOCKS: dict[str, Callable[[], Table]] = {
    "claims": claims,
    "statuses": statuses_of_groups,
    "real_lines": models_of_real_lines,
    "free_decays": free_decays,
    "exact_terms": exact_terms,
    "published": published_statuses,
    "weak_term": weak_term,
    "lines_of_study": lines_of_study,
    "two_modes": two_modes,
}


def with_tables(text: str) -> str:
    """Return the text of a page with its marked tables made from the results."""

    def made(match: re.Match) -> str:
        head, *rows = BLOCKS[match[2]]()
        lines = [head, ("---",) * len(head), *rows]
        shown = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        return f"{match[1]}\n{shown}\n\n{match[3]}"

    return BLOCK.sub(made, text)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        page = Path(name)
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")
