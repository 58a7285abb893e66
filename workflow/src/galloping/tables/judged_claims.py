"""Assessment of the paper's claims by the study's draws.

It is for every measurement setup and method, for the paper's, and at other values of the settings
that the paper does not print.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from galloping.cycles.family import initial_state
from galloping.evaluation.motion import steady_amplitude
from galloping.line.galerkin import coefficients
from galloping.paper.claims import (
    CLAIMS,
    HELD_VERDICTS,
    SHARE_COLUMNS,
    UNJUDGED_CLAIMS,
    Claim,
    find_joint_draws,
    judge,
    share_with_interval,
    verdict_of_share,
)
from galloping.paper.draws import Amounts, line_motion, paper_draws
from galloping.paper.unknowns import UNKNOWNS
from galloping.recording.measurement import Motion
from galloping.results import NOISE, PAPER_METHOD, PAPER_PROTOCOL

COLUMNS = (
    "claim", "source", "case", "direction", "quantity", "paper_value", "study_value", "low", "high",
    "ratio", "spread", "share_met", "share_met_low", "share_met_high", "replicates", "protocol",
    "method", "verdict", "reason",
)  # fmt: skip
PAPER_COLUMNS = (
    "claim", "statement", "role", "case", "noise_level", "points", "direction", "printed", "median",
    "low", "high", "ratio", "spread", "share_met", "share_met_low", "share_met_high", "verdict",
    "reason",
)  # fmt: skip
JOINT_ROLE, BEYOND_ROLE = "joint", "beyond"  # roles of rows outside the count of single claims
CLAIM_COLUMNS = {"median": "study_value", "printed": "paper_value"}  # names in claims.csv
PAPER_PAIR = (PAPER_PROTOCOL, PAPER_METHOD)
# columns of the line's own motion
CHANGE_COLUMN, ATTACK_COLUMN = "steady_change", "attack_angle"
# replaces protocol and method in claims about the line
LINE_PAIR = ("exact", "two-mode model")


def claims_table(
    scores: pd.DataFrame,
    settings: Mapping,
    draws: Mapping[str, pd.DataFrame] | None = None,
    trajectories: Mapping[str, Sequence[Motion]] | None = None,
) -> pd.DataFrame:
    """Assess each claim of the reproduced paper for every measurement setup and method.

    Assessed are the claims about one of the cases. scores: of all replicates. settings: cases,
    those that are assessed; pairs of protocol and method; steady_window in s; winds, m/s by case.
    draws: many draws of the paper's study by its own method, by case, in place of the replicates of
    that method. trajectories: the motions of a case, that of the claims first. Columns: COLUMNS,
    study_value the median.
    """
    rows = []
    for claim in CLAIMS:
        for case in settings["cases"]:
            if claim.case not in ("", case):
                continue
            if claim.column.startswith((CHANGE_COLUMN, ATTACK_COLUMN)):
                if trajectories and case in trajectories:
                    motion = trajectories[case][0]
                    wind = settings["winds"][case]
                    found = _measure_motion(motion, settings["steady_window"], wind)
                    rows.append(_claim_row(claim, case, LINE_PAIR, found))
                continue
            for pair in map(tuple, settings["pairs"]):
                if pair == PAPER_PAIR and draws and case in draws:
                    rows.append(_claim_row(claim, case, pair, draws[case]))
                    continue
                pair_scores = scores[
                    (scores["protocol"] == pair[0]) & (scores["method"] == pair[1])
                ]
                if claim.cell_kind in set(pair_scores["kind"]):  # else it cannot use them
                    rows.append(
                        _claim_row(claim, case, pair, pair_scores[pair_scores["case"] == case])
                    )
    return pd.DataFrame(rows, columns=COLUMNS)


def paper_table(
    claims: pd.DataFrame, draws: Mapping[str, pd.DataFrame], settings: Mapping
) -> pd.DataFrame:
    """Compare each value in the reproduced paper with noise realisations of the paper's method.

    There is a row for each printed number or bound. claims: claims.csv. draws: as of
    `claims_table`. settings: departures, why the claims about a case of the paper are not assessed,
    "" if they are. Below each case's rows are the shares of the draws that satisfy all its bounds
    at once, and at the end claims without an assessment. Columns: PAPER_COLUMNS; role: of the
    claim, `joint` or `beyond`.
    """
    pairs = zip(claims["protocol"], claims["method"], strict=True)
    paper_claims = claims[[pair in (PAPER_PAIR, LINE_PAIR) for pair in pairs]]
    rows: list[dict] = []
    for case, departure in settings["departures"].items():
        case_claims = [claim for claim in CLAIMS if claim.case in ("", case)]
        if departure:
            why = {"case": case, "verdict": "not judged", "reason": departure}
            rows += [{**_cell_columns(claim), **why, "paper_value": claim.printed,
                      "direction": claim.direction} for claim in case_claims]  # fmt: skip
            continue
        of_case = paper_claims[paper_claims["case"] == case].set_index("claim").to_dict("index")
        rows += [{**of_case[c.name], **_cell_columns(c)} for c in case_claims if c.name in of_case]
        rows += _joint_rows(case_claims, case, draws[case])
    rows += [{**_cell_columns(claim), "role": BEYOND_ROLE, "case": "",
              "verdict": "beyond judgement", "reason": claim.note}
             for claim in UNJUDGED_CLAIMS]  # fmt: skip
    table = pd.DataFrame(rows, columns=[CLAIM_COLUMNS.get(name, name) for name in PAPER_COLUMNS])
    return table.set_axis(PAPER_COLUMNS, axis=1).astype({"points": "Int64"})


def _cell_columns(claim: Claim) -> dict:
    level = None if claim.minus_level is not None else claim.level  # one that compares two levels
    return {"claim": claim.name, "statement": claim.statement, "role": claim.role,
            "noise_level": level, "points": claim.points}  # fmt: skip


def _joint_rows(claims: Sequence[Claim], case: str, draws: pd.DataFrame) -> list[dict]:
    """Tabulate the shares of the draws that satisfy the bounds of R2, or all bounds, at once."""
    bounds = [
        claim
        for claim in claims
        if claim.is_counted and not claim.is_number and claim.level > 0 and claim.column in draws
    ]
    of_r2 = [claim for claim in bounds if claim.is_r2]
    rows = []
    for name, group in (("R2 bounds", of_r2), ("claims except printed errors", bounds)):
        if len(group) < 2 or (is_joint := find_joint_draws(group, draws)) is None:
            continue
        interval = share_with_interval(is_joint)
        share, low, high = (100 * interval[key] for key in SHARE_COLUMNS)
        rows.append({
            "claim": f"all {len(group)} {name} at once", "role": JOINT_ROLE, "case": case,
            "direction": "",
            **{CLAIM_COLUMNS.get(key, key): value for key, value in interval.items()},
            "verdict": verdict_of_share(interval),
            "reason": f"{share:.0f} % ({low:.0f} to {high:.0f} %) of {len(is_joint)} realisations",
        })  # fmt: skip
    return rows


def _measure_motion(motion: Motion, window: tuple[float, float], wind: float) -> pd.DataFrame:
    """Measure the unsteadiness of the line's own motion in each direction, and its attack angle.

    Columns: steady_change_NAME_percent, of each amplitude between the halves of the window;
    attack_angle, the largest |dq_v| / U over the record.
    """
    start, end = window
    middle = (start + end) / 2
    halves = [
        steady_amplitude(motion.states[(motion.time >= a) & (motion.time <= b), :2])
        for a, b in ((start, middle), (middle, end))
    ]
    change = 100 * np.abs(halves[1] / halves[0] - 1)
    attack = np.abs(motion.states[:, motion.names.index("dq_v")]).max() / wind
    return pd.DataFrame({
        **{f"{CHANGE_COLUMN}_{motion.names[k]}_percent": [change[k]] for k in (0, 1)},
        ATTACK_COLUMN: [attack], "kind": NOISE, "level": 0.0, "missing": 0, "spurious": 0,
        "motion": "ok",
    })  # fmt: skip


def _claim_row(claim: Claim, case: str, pair: tuple[str, str], scores: pd.DataFrame) -> dict:
    attributes = {name: getattr(claim, name) for name in ("source", "direction", "quantity")}
    judgment = {
        CLAIM_COLUMNS.get(name, name): value for name, value in judge(claim, scores).items()
    }
    return {
        "claim": claim.name, **attributes, "case": case, "paper_value": claim.printed, **judgment,
        "protocol": pair[0], "method": pair[1],
    }  # fmt: skip


def variation_rows(
    case: Mapping,
    plan: Mapping,
    amounts: Amounts,
    parameter: str,
    values: Sequence[float],
    name: str,
    drawn: pd.DataFrame,
) -> pd.DataFrame:
    """Assess the reproduced paper's claims for several values of a parameter the paper omits.

    case: settings of the line with its initial state; name: of the paper's case. plan, amounts:
    keywords of `paper_draws`. parameter: its name in UNKNOWNS. drawn: the study's own draws, for
    its own settings. Columns parameter, unit, value, is_default (whether it is the case's own),
    is_reproduced, then those of the claims table.
    """
    tables = []
    opened = next(unknown for unknown in UNKNOWNS if unknown.name == parameter)
    for value in values:
        varied, other = opened.set_in(case, value), plan
        if not opened.path:  # the threshold is of the method, not of the line
            is_own, other = value == plan["threshold"], {**plan, "threshold": value}
        else:  # the model and its release are the same to rounding
            ours, others = (
                [*coefficients(each).values(), *initial_state(each)] for each in (case, varied)
            )
            is_own = np.allclose(ours, others, rtol=1e-8, atol=1e-12)
        scores = drawn
        if not is_own:
            scores = paper_draws(varied, name=(name,), amounts=amounts, **other)
        motion, _ = line_motion(varied, amounts.duration, amounts.sampling_rate)
        options = {"cases": [name], "pairs": [PAPER_PAIR], "steady_window": amounts.steady_window,
                 "winds": {name: varied["wind"]["speed"]}}  # fmt: skip
        table = claims_table(scores, options, {name: scores}, {name: [motion]})
        keys = {"parameter": parameter, "unit": opened.unit, "value": value}
        keys |= {"is_default": is_own, "is_reproduced": table["verdict"].isin(HELD_VERDICTS)}
        tables.append(table.assign(**keys)[[*keys, *COLUMNS]])
    return pd.concat(tables, ignore_index=True)
