"""Values that the inputs of a model are held at, as the command is told them."""

from collections.abc import Sequence

import numpy as np

VALUES, MOST_VALUES = 9, 200  # of a range, where no step is said; and at all
ROUNDING = 1e-9  # of a range, in steps


def held_at(texts: Sequence[str], inputs: Sequence[str]) -> dict[str, float | np.ndarray]:
    """Values of inputs by name, from `U=12`, or `U=8:16` and `U=8:16:0.5`, a range.

    Raises ValueError where a text has another form or names no input.
    """
    found: dict[str, float | np.ndarray] = {}
    for text in texts:
        name, _, said = (part.strip() for part in text.partition("="))
        if name not in inputs:
            has = f"has the inputs {', '.join(inputs)}" if inputs else "has no inputs"
            raise ValueError(f"--at {text}: the model {has}")
        try:
            values = [float(part) for part in said.split(":")]
        except ValueError:
            values = []
        low, high, *step = [*values, *values] if len(values) == 1 else values or [np.nan] * 4
        step = step or [(high - low) / (VALUES - 1)]
        if not (np.isfinite([low, high, *step]).all() and low <= high and len(step) == 1):
            raise ValueError(
                f"--at {text}: must be one value, {name}=12, or a range with or without a step, "
                f"{name}=8:16 or {name}=8:16:0.5"
            )
        if low == high:
            found[name] = low
            continue
        count = int((high - low) / step[0] + ROUNDING) + 1 if step[0] > 0 else 0
        if not 2 <= count <= MOST_VALUES:
            raise ValueError(f"--at {text}: must be 2 to {MOST_VALUES} values")
        found[name] = low + step[0] * np.arange(count)
    return found
