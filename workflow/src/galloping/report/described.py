"""The settings of a study and the versions behind it, as the report shows them."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib import metadata

from galloping.publication.provenance import commit

LIBRARIES = ("numpy", "scipy", "pandas", "heyoka", "numba", "pysindy", "matplotlib", "snakemake")


def described(study: Mapping) -> list[tuple[str, str]]:
    """Pairs of a name and values with units: each line in its wind, and what is measured of it.

    study: the settings, in plain values.
    """
    return (_of_lines(study) if study["cases"] else []) + [
        (name, _trial(trial)) for name, trial in study["trials"].items()
    ]


def _of_lines(study: Mapping) -> list[tuple[str, str]]:
    lines = [(name, _line(case)) for name, case in study["cases"].items()]
    simulation, measurement = study["simulation"], study["measurement"]
    return [
        *lines,
        ("record", f"{simulation['duration']:g} s at {simulation['sampling_rate']:g} Hz"),
        ("noise levels", ", ".join(f"{level:g}" for level in measurement["levels"])),
        ("subsets", f"{', '.join(f'{n:,}' for n in measurement['subsets']['points'])} samples"),
        ("replicates", f"{measurement['replicates']}, drawn from seed {measurement['seed']}"),
        ("protocols", ", ".join(measurement["protocols"])),
        ("methods", ", ".join(study["identification"]["methods"])),
        ("candidate library", f"polynomials up to degree {study['identification']['degree']}"),
    ]


def _trial(trial: Mapping) -> str:
    text = f"{trial['kind'].replace('_', ' ')}, {trial['replicates']} replicates"
    return f"{text}, drawn from seed {trial['seed']}"


def _line(case: Mapping) -> str:
    line, conductor = case["line"], case["conductor"]
    return (
        f"span {line['span']:g} m, tension {line['tension'] / 1000:g} kN a sub-conductor, "
        f"{case['bundle']['subconductors']} sub-conductors of {conductor['mass']:g} kg/m, "
        f"wind {case['wind']['speed']:g} m/s, damping ratios {case['damping']['vertical']:g} and "
        f"{case['damping']['horizontal']:g}"
    )


def made_by() -> str:
    """The commit that a report is made by, in words."""
    known = commit()
    if known is None:
        return "code that is in no git repository"
    changed = f", with {len(known.changes)} files changed since" if known.changes else ""
    return f"commit {known.digest[:12]} of {known.date[:10]}{changed}"


def versions() -> dict[str, str]:
    """Of Python and the libraries that numbers and figures come from."""
    return {"python": platform.python_version(), **{n: metadata.version(n) for n in LIBRARIES}}
