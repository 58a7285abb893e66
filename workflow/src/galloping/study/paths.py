"""Where a study keeps its files."""

from __future__ import annotations

from dataclasses import dataclass, fields

CELL = "{case}/{protocol}/{cell}"


@dataclass(frozen=True)
class Paths:
    """Patterns with the names of cases, cells and so on in braces."""

    model: str = "models/{case}.json"
    trajectory: str = "trajectories/{case}.npz"
    ranking: str = "bounds/{case}/further_recordings.csv"
    recordings: str = f"recordings/{CELL}.npz"
    field: str = "recordings/{recording}/{file}"
    identified: str = f"identified/{CELL}/{{family}}.npz"
    bounds: str = f"bounds/{CELL}.npz"
    scores: str = f"scores/{CELL}.csv"
    oracle: str = f"oracles/{CELL}.csv"
    reconstructions: str = f"reconstructions/{CELL}.npz"
    cycles: str = "sweeps/{case}/{sweep}/cycles.csv"
    bifurcations: str = "sweeps/{case}/{sweep}/bifurcations.csv"
    block: str = "sweeps/{case}/{sweep}/simulated/{block}.csv"
    clearance: str = "assessment/{case}/clearance.csv"
    measures: str = "assessment/{case}/measures.csv"
    orbits: str = "assessment/{case}/orbits.npz"
    prediction: str = "assessment/{case}/prediction_{protocol}.csv"
    paper_draws: str = "paper/{case}.csv"
    openness: str = "reproduction/{parameter}.csv"
    trial: str = "trials/{trial}/{batch}.csv"
    animation: str = "figures/galloping.gif"
    table: str = "tables/{table}.csv"
    figure: str = "figures/{figure}.{form}"
    report: str = "report.html"

    @classmethod
    def below(cls, results: str) -> Paths:
        """Those of a folder of results."""
        return cls(**{field.name: f"{results}/{field.default}" for field in fields(cls)})
