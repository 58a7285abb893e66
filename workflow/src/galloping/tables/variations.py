"""What the settings that the paper leaves open decide: its claims, held or not, at other values."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from galloping.cycles.family import PARAMETERS, Parameter, entry, initial_state
from galloping.paper.claims import HELD
from galloping.paper.draws import Amounts, line_motion, paper_draws
from galloping.physics.galerkin import coefficients
from galloping.results import PAPER_METHOD, PAPER_PROTOCOL
from galloping.tables.judged_claims import COLUMNS, claims_table

THRESHOLD = "threshold"  # of the method, not of the line
OPEN = {
    **{
        name: PARAMETERS[name]
        for name in ("wind_speed", "damping_vertical", "damping_horizontal", "bundle_dimension")
    },
    "release_vertical": Parameter("vertical release", "m", entry("initial_state", "q_v")),
    "release_horizontal": Parameter("horizontal release", "m", entry("initial_state", "q_w")),
    THRESHOLD: Parameter("threshold", "1", lambda case, value: dict(case)),
}


def variation_rows(
    case: Mapping,
    plan: Mapping,
    amounts: Amounts,
    values: Mapping[str, Sequence[float]],
    name: str,
    drawn: pd.DataFrame,
) -> pd.DataFrame:
    """Every claim of the paper for every value of every open setting, one varied at a time.

    case: settings of the line with its release; name: the paper's, by which claims are about it.
    plan, amounts: keywords of `paper_draws`. values: by name in OPEN. drawn: the study's own draws,
    by which its own settings are judged. Columns parameter, unit, value, default (whether it is the
    case's own), held, then those of the claims table. Raises ValueError for a name that is not
    open.
    """
    if unknown := sorted(set(values) - set(OPEN)):
        raise ValueError(f"{unknown[0]}: the paper does not leave it open; {', '.join(OPEN)}")
    tables = []
    for parameter, of in values.items():
        for value in of:
            varied, other = OPEN[parameter].at(case, value), plan
            if parameter == THRESHOLD:
                is_own, other = value == plan["threshold"], {**plan, "threshold": value}
            else:  # the model and its release are the same to rounding
                sides = (
                    [*coefficients(each).values(), *initial_state(each)] for each in (case, varied)
                )
                is_own = np.allclose(*sides, rtol=1e-8, atol=1e-12)
            if not is_own:
                found = paper_draws(varied, name=(name,), amounts=amounts, **other)
            table = _claims(varied, drawn if is_own else found, amounts, name)
            place = {"parameter": parameter, "unit": OPEN[parameter].unit, "value": value}
            held = table["verdict"].isin(HELD)
            table = table.assign(**place, default=is_own, held=held)
            tables.append(table[[*place, "default", "held", *COLUMNS]])
    return pd.concat(tables, ignore_index=True)


def _claims(case: Mapping, drawn: pd.DataFrame, amounts: Amounts, name: str) -> pd.DataFrame:
    motion, _ = line_motion(case, amounts.duration, amounts.sampling_rate)
    settings = {
        "cases": [name],
        "pairs": [(PAPER_PROTOCOL, PAPER_METHOD)],
        "steady_window": amounts.steady_window,
    }
    return claims_table(drawn, settings, {name: drawn}, {name: [motion]})
