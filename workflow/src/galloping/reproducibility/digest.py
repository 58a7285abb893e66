"""Digest of the code of a script, for reruns after edits; and the provenance of a study.

Snakemake tracks a rule's script by its time, and not at all what the script imports. The digest
covers the script and its imports from this package, transitively, with the templates and tables of
data beside them. It ignores comments, docstrings and layout, and modules that run a script's work
but do not affect it. Versions of the imported libraries are recorded too. The provenance is the
commit, Python, the packages and the machine.
"""

import ast
import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from galloping import deferred

PACKAGE = Path(__file__).parents[1].name
# modules without effect on numbers: logs, receipts, messages and progress
UNCOUNTED_MODULES = (f"{PACKAGE}.reproducibility.job", f"{PACKAGE}.progress_reports")
DOCSTRING_NODES = (ast.Module, ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


@cache
def code(*roots: str | Path) -> dict:
    """Compute a digest of scripts and of all code of this package that they import.

    Added are the versions of the libraries that this code uses. roots: script files, and functions
    that they import by name, as `deferred` gives them. Raises ValueError for a module that is not
    in the package.
    """
    files = _import_closure(roots)
    texts = []
    for path in files:  # names do not depend on the place of the repository or of the script
        is_own = path.is_relative_to(deferred.SOURCE)
        name = path.relative_to(deferred.SOURCE).as_posix() if is_own else "script"
        texts.append(f"{name}\n{_parse_module(path).content}\n")
        if is_own:
            for suffix in ("jinja", "csv", "mplstyle"):
                texts += [data.read_text("utf-8") for data in path.parent.glob(f"*.{suffix}")]
    libraries = frozenset().union(*(_parse_module(path).libraries for path in files))
    return {
        "digest": hashlib.sha256("".join(sorted(texts)).encode()).hexdigest()[:16],
        "libraries": versions(libraries),
    }


def _import_closure(roots: tuple[str | Path, ...]) -> set[Path]:
    """Collect the files of the package that `roots` import, and those of `roots`."""
    files: set[Path] = set()
    waiting: list[Path] = []
    for root in map(str, roots):
        module = root.partition(":")[0]
        if root.endswith(".py"):
            waiting.append(Path(root))
        elif deferred.file_of(module):
            waiting += _module_files(module)
        else:
            raise ValueError(f"{module}: no such module")
    while waiting:
        path = waiting.pop()
        if path not in files:
            files.add(path)
            waiting += _parse_module(path).modules
    return files


@dataclass(frozen=True)
class _Module:
    """Relevant content of one file. modules: files of the package, libraries: other packages."""

    content: str
    modules: tuple[Path, ...]
    libraries: frozenset[str]


@cache
def _parse_module(path: Path) -> _Module:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names: set[str] = set()
    for node in (tree, *_walk_statements(tree)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:  # absolute: ruff refuses others
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, DOCSTRING_NODES) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    tops = {name.partition(".")[0] for name in names}
    files = {
        file for name in names if name.partition(".")[0] == PACKAGE for file in _module_files(name)
    }
    return _Module(
        content=ast.dump(tree),
        modules=tuple(sorted(files)),
        libraries=frozenset(tops - {PACKAGE} - sys.stdlib_module_names),
    )


def _walk_statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements below a node: a small part of what `ast.walk` visits."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.excepthandler, ast.match_case)):
            yield child
            yield from _walk_statements(child)


def _module_files(name: str) -> list[Path]:
    """List the files that importing a module runs: its own and those of its parents."""
    parts = name.split(".")
    names = (".".join(parts[: k + 1]) for k in range(len(parts)))
    return [
        file for name in names if name not in UNCOUNTED_MODULES and (file := deferred.file_of(name))
    ]


def versions(imported: Iterable[str]) -> dict[str, str]:
    """Return versions of Python, of the distributions behind imports, and their requirements."""
    installed: dict[str, str] = {}
    named = (name for module in imported for name in _distributions_by_import().get(module, ()))
    waiting: list[str] = list(map(canonicalize_name, named))
    while waiting:
        name = waiting.pop()
        if name not in installed and (distribution := _find_distribution(name)):
            installed[name], requirements = distribution
            waiting += requirements
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **dict(sorted(installed.items()))}


_distributions_by_import = cache(metadata.packages_distributions)


@cache
def _find_distribution(name: str) -> tuple[str, list[str]] | None:
    """Return the version and the requirements of a distribution, None if it is not installed."""
    try:
        described = metadata.distribution(name).metadata
    except metadata.PackageNotFoundError:
        return None
    requirements = map(Requirement, described.get_all("Requires-Dist") or [])
    return described["Version"], [
        canonicalize_name(requirement.name)
        for requirement in requirements
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""})
    ]


@dataclass(frozen=True)
class Commit:
    """Git commit that is checked out: its hash, date and description, and the changed files.

    digest: of the commit. date: of the commit (ISO 8601). described: output of `git describe`.
    changes: files that differ from the commit.
    """

    digest: str
    date: str
    described: str
    changes: tuple[str, ...]


def commit(study: Mapping[str, str]) -> Commit | None:
    """Return the git commit of this library, or None if no repository tracks it.

    study: settings `results` and `reference`. A file in the former is no change if git does not
    track it, unless it is in the latter.
    """
    try:
        _run_git("ls-files", "--error-unmatch", f"{PACKAGE}/__init__.py")
        root = Path(_run_git("rev-parse", "--show-toplevel").rstrip("\n"))
        digest, date = _run_git("show", "--no-patch", "--format=%H %cI", "HEAD").split()
        described = _run_git("describe", "--tags", "--always", "--dirty").strip()
        status = _run_git("status", "-z", "--no-renames", "--untracked-files=all").split("\0")[:-1]
    except (OSError, subprocess.CalledProcessError):
        return None
    results, reference = (Path(study[name]).resolve() for name in ("results", "reference"))

    def is_result(path: Path) -> bool:
        return path.is_relative_to(results) and not path.is_relative_to(reference)

    changes = (line[3:] for line in status if line[:2] != "??" or not is_result(root / line[3:]))
    return Commit(digest, date, described, tuple(changes))


def environment() -> dict:
    """Return the versions of Python and of all packages, and properties of the machine."""
    packages = {canonicalize_name(d.name): d.version for d in metadata.distributions()}
    return {
        "python": platform.python_version(),
        "packages": dict(sorted(packages.items())),
        "machine": {
            "system": platform.system(),
            "release": platform.release(),
            "architecture": platform.machine(),
            "cores": os.cpu_count(),
        },
    }


def _run_git(*arguments: str) -> str:
    command = ["git", "-C", str(deferred.SOURCE), "-c", "log.showSignature=false", *arguments]
    return subprocess.check_output(command, stderr=subprocess.DEVNULL, text=True)
