"""Equilibria and all limit cycles that leave them along a parameter: the bifurcation diagram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from galloping.cycles.continuation import Branch, Range
from galloping.cycles.equilibria import equilibrium_branch, hopf_points
from galloping.cycles.family import Family
from galloping.cycles.limit_cycles import (
    BRANCH_POINT,
    PERIOD_DOUBLING,
    from_branching,
    from_hopf,
)


@dataclass(frozen=True)
class Named:
    """A branch of limit cycles and where it comes from, such as `Hopf 1, period doubling 1`."""

    name: str
    branch: Branch


@dataclass(frozen=True)
class Diagram:
    """equilibria: one branch. cycles: all branches that leave it, each after its origin.

    failures: what could not be followed, in words; a branch that stopped early says so itself.
    """

    family: Family
    equilibria: Branch
    cycles: tuple[Named, ...]
    failures: tuple[str, ...]


def diagram(
    family: Family, span: Range, n_states: int, depth: int = 1, ceiling: float = np.inf
) -> Diagram:
    """The diagram of the equilibrium near the origin, over the range `span`.

    depth: how many period doublings and branch points in a row are followed. ceiling: size (root
    mean square, units of the states) beyond which orbits are not followed. Raises ValueError where
    there is no equilibrium near the origin.
    """
    equilibria = equilibrium_branch(family, np.zeros(n_states), span.low, span)
    cycles, failures = [], []
    queue: list[tuple[str, Sequence[Branch], int]] = []
    for k, hopf in enumerate(hopf_points(equilibria), start=1):
        try:
            queue.append((f"Hopf {k}", (from_hopf(family, hopf, span, ceiling=ceiling),), 0))
        except ValueError as failure:
            failures.append(f"Hopf {k}: {failure}")
    while queue:
        name, branches, level = queue.pop(0)
        for side, branch in enumerate(branches):
            full = name if len(branches) == 1 else f"{name} side {side + 1}"
            cycles.append(Named(full, branch))
            if level == depth:
                continue
            for kind in (PERIOD_DOUBLING, BRANCH_POINT):
                found = [b for b in branch.bifurcations if b.name == kind]
                for k, at in enumerate(found, start=1):
                    origin = f"{full}, {kind} {k}"
                    try:
                        leaving = from_branching(family, at, span, ceiling=ceiling)
                    except ValueError as failure:
                        failures.append(f"{origin}: {failure}")
                    else:
                        queue.append((origin, leaving, level + 1))
    return Diagram(family, equilibria, tuple(cycles), tuple(failures))
