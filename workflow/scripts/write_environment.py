"""Write workflow/envs/galloping.yaml, for `snakemake --sdm conda`, from pyproject.toml."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
ENVIRONMENT = ROOT / "workflow" / "envs" / "galloping.yaml"
CONDA_NAMES = {"matplotlib": "matplotlib-base"}  # names that differ from those on PyPI
PYPI_PACKAGES = {"pysindy"}
HEAD = """\
# For `snakemake --sdm conda`: what jobs import. Written by `make lock` from pyproject.toml; `make`
# installs the same packages, pinned with their hashes in requirements.lock.
channels:
  - conda-forge
  - nodefaults
dependencies:
"""


def requirements(project: dict, extra: str) -> Iterator[tuple[str, str]]:
    """Yield name and version range of each package that a project with an extra requires."""
    listed = [*project["dependencies"], *project["optional-dependencies"][extra]]
    for requirement in listed:
        name, within, versions = re.fullmatch(
            r"([\w.-]+)(?:\[([\w,]+)\])?([^;]*)(?:;.*)?", requirement
        ).groups()
        if name == project["name"]:
            for other in within.split(","):
                yield from requirements(project, other)
        else:
            yield name, versions.strip()


def environment(pyproject: str) -> str:
    """Format the conda environment file for jobs, which need no Snakemake, from pyproject.toml."""
    project = tomllib.loads(pyproject)["project"]
    needed = {
        name.lower(): versions
        for name, versions in requirements(project, "study")
        if not name.startswith("snakemake")
    }
    conda = {
        "python": project["requires-python"],
        **{CONDA_NAMES.get(n, n): v for n, v in sorted(needed.items()) if n not in PYPI_PACKAGES},
        "pip": "",
    }
    pip = {name: versions for name, versions in needed.items() if name in PYPI_PACKAGES}
    lines = [f"  - {name} {versions}".rstrip() for name, versions in conda.items()]
    lines += [
        "  - pip:",
        *(f"      - {name} {versions}".rstrip() for name, versions in pip.items()),
    ]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    ENVIRONMENT.write_text(environment((ROOT / "pyproject.toml").read_text("utf-8")), "utf-8")
