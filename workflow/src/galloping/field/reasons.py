"""What a verdict's reason means, in the words of an engineer, and what would help.

`reasons.csv` has parts of reasons, what each means and what would help, those that weigh more
first.
"""

import csv
import re
from functools import cache
from importlib.resources import files

HELPS = {
    "wind": "the wind speed, recorded beside the motion (`--input`)",
    "places": "sensors at more places along the span, which tell its modes apart (`position` in a "
    "mapping)",
    "directions": "sensors in both directions",
    "fewer": "fewer candidate terms (`--library`, `--degree`)",
    "clocks": "one clock for all sensors, and samples at regular times",
}
WIND, PLACES = HELPS["wind"], HELPS["places"]


@cache
def _reasons() -> list[tuple[str, str, str]]:
    text = files(__package__).joinpath("reasons.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return [(row["pattern"], row["meaning"], row["help"].format(**HELPS)) for row in rows]


def plain_reasons(reason: str) -> list[tuple[str, str]]:
    """What the parts of a verdict's reason mean, and what would help; none where it has none.

    That the model is inadequate, the last of all, is said where nothing tells more.
    """
    known, fitting = _reasons(), {}
    for clause in reason.split("; "):
        matches = ((k, re.search(pattern, clause)) for k, (pattern, *_) in enumerate(known))
        k, match = next(filter(lambda each: each[1], matches), (None, None))
        if match:
            fitting.setdefault(k, tuple(match.expand(text) for text in known[k][1:]))
    found = [fitting[k] for k in sorted(fitting)]
    return found[:-1] if len(found) > 1 and len(known) - 1 in fitting else found
