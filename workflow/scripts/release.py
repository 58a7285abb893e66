"""Check and build a release, without publishing anything: release.py FOLDER [--draft].

FOLDER receives the wheel and the source distribution, built from the files that git tracks. Links
and pictures of the README that a package index shows point to the repository. With --draft open
objections are listed, and the distributions are built nevertheless.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
PLACEHOLDERS = ("example.org", "The galloping authors")
LINK = re.compile(r"(!?)(\[[^\]]*\]\()(?![a-z]+:|#)([^)]+)\)")
RELEASE_HEADING = re.compile(r"^## (\S+) - \d{4}-\d{2}-\d{2}$", re.MULTILINE)


def objections(root: Path) -> Iterator[str]:
    """Yield a line of text for each reason against a release, such as a leftover placeholder."""
    text = (root / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    citation, security = (
        (root / name).read_text(encoding="utf-8") for name in ("CITATION.cff", "SECURITY.md")
    )
    for source, content in (
        ("pyproject.toml", text), ("CITATION.cff", citation), ("SECURITY.md", security),
    ):  # fmt: skip
        for placeholder in PLACEHOLDERS:
            if placeholder in content:
                yield f"{source}: {placeholder!r} is a placeholder"
    version = project["version"]
    library_version = re.search(
        r'__version__ = "(.+)"', (root / "workflow/src/galloping/__init__.py").read_text()
    )
    for source, stated in (("galloping.__version__", library_version[1]),
                         ("CITATION.cff", str(yaml.safe_load(citation)["version"]))):  # fmt: skip
        if stated != version:
            yield f"{source}: {stated}; pyproject.toml has {version}"
    dated = RELEASE_HEADING.findall((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    if version not in dated:
        yield f"CHANGELOG.md: no entry '## {version} - DATE'"


def with_full_links(readme: str, source: str, version: str) -> str:
    """Replace relative links in a README by URLs, so that they work on a package index."""

    def full(match: re.Match) -> str:
        picture, before, target = match.groups()
        kind = "raw" if picture else "blob"
        return f"{picture}{before}{source}/{kind}/v{version}/{target})"

    return LINK.sub(full, readme)


def build(root: Path, folder: Path) -> subprocess.CompletedProcess:
    """Build the wheel and source distribution of a project from the files that git tracks."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    try:
        tracked = subprocess.run(
            ["git", "ls-files", "-z"], cwd=root, check=True, capture_output=True, text=True
        ).stdout.split("\0")
    except (OSError, subprocess.CalledProcessError):
        sys.exit(f"{root}: git tracks no files here; a release needs a git clone")
    with tempfile.TemporaryDirectory() as copy:
        for name in filter(None, tracked):
            if (root / name).is_file():
                Path(copy, name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, Path(copy, name))
        readme = Path(copy, "README.md")
        text = readme.read_text(encoding="utf-8")
        source = project["urls"]["Source"]
        readme.write_text(with_full_links(text, source, project["version"]), encoding="utf-8")
        return subprocess.run(
            [sys.executable, "-m", "build", "--outdir", str(folder.resolve()), copy],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip


def main() -> int:
    """Print reasons against a release, build without any or as a draft, return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--draft", action="store_true")
    args = parser.parse_args()
    faults = list(objections(ROOT))
    print(*faults, sep="\n", end="\n" * bool(faults))
    if faults and not args.draft:
        print("Nothing was built; --draft builds all the same")
        return 1
    result = build(ROOT, args.folder)
    print(result.stdout if result.returncode else f"{args.folder}: built, nothing is published")
    return result.returncode


if __name__ == "__main__":
    sys.exit(main())
