"""models/{case}.json: the true equations of a line, and what else follows from its parameters."""

from __future__ import annotations

import os
from dataclasses import asdict

import numpy as np

from galloping.physics.galerkin import Derived
from galloping.polynomial import PolynomialModel
from galloping.storage import read_json, write_json


def write(path: str | os.PathLike, derived: Derived) -> None:
    """Human-readable, and exact to the last bit."""
    model = asdict(derived.model) | {"coefficients": derived.model.coefficients.tolist()}
    content = {**derived.quantities, "coefficients": dict(derived.coefficients), "model": model}
    write_json(path, content)


def read(path: str | os.PathLike) -> Derived:
    content = read_json(path)
    model = content.pop("model")
    equations = PolynomialModel(
        tuple(model["states"]), tuple(map(tuple, model["terms"])), np.array(model["coefficients"])
    )
    return Derived(equations, content.pop("coefficients"), content)
