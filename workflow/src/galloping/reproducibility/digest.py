"""Digest of the code that a script runs, so that Snakemake reruns what an edit touches.

Snakemake tracks a rule's script by its time, and not at all what the script imports. The digest
covers the script and its imports from this package, transitively. It leaves out what does not
change what they do: comments, docstrings, layout, and where imports and definitions stand; and
modules that run a script's work but have no part in it.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from galloping.reproducibility.libraries import versions

SOURCE = Path(__file__).parents[2]
PACKAGE = Path(__file__).parents[1].name
# Logs, receipts and messages: no number depends on them.
UNCOUNTED = (f"{PACKAGE}.reproducibility.job",)
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
DOCUMENTED = (ast.Module, *DEFINITIONS)
IMPORTS = (ast.Import, ast.ImportFrom)


@cache
def code(*roots: str | Path) -> dict:
    """What `roots` run, as plain values: digest of the code, versions of the libraries it uses.

    roots: script files, or `module` or `module:function` of what is imported by name at run time.
    Raises ValueError for a module that is not in the package.
    """
    files = _closure(roots)
    texts = []
    for path in files:  # named as wherever the repository lies and a script is called
        name = path.relative_to(SOURCE).as_posix() if path.is_relative_to(SOURCE) else "script"
        texts.append(f"{name}\n{_parse(path).content}\n")
        if path.is_relative_to(SOURCE):
            texts += [template.read_text("utf-8") for template in path.parent.glob("*.jinja")]
    libraries = frozenset().union(*(_parse(path).libraries for path in files))
    return {
        "digest": hashlib.sha256("".join(sorted(texts)).encode()).hexdigest()[:16],
        "libraries": versions(libraries),
    }


def _closure(roots: tuple[str | Path, ...]) -> set[Path]:
    """Files of the package that `roots` import, and those of `roots`."""
    seen: set[Path] = set()
    waiting: list[Path] = []
    for root in roots:
        module = str(root).partition(":")[0]
        waiting += [Path(root)] if Path(root).suffix == ".py" else _files(module)
        if Path(root).suffix != ".py" and not _find(module):
            raise ValueError(f"{module}: no such module")
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen.add(path)
            waiting += _parse(path).modules
    return seen


@dataclass(frozen=True)
class _Module:
    """What counts of one file. modules: files of the package, libraries: other packages."""

    content: str
    modules: tuple[Path, ...]
    libraries: frozenset[str]


@cache
def _parse(path: Path) -> _Module:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names: set[str] = set()
    for node in (tree, *_statements(tree)):
        if isinstance(node, IMPORTS):
            names |= _imported(node, path)
        elif isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    tops = {name.partition(".")[0] for name in names}
    files = {file for name in names if name.partition(".")[0] == PACKAGE for file in _files(name)}
    return _Module(
        content=_content(tree),
        modules=tuple(sorted(files)),
        libraries=frozenset(tops - {PACKAGE} - sys.stdlib_module_names),
    )


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below a node: a small part of what `ast.walk` goes through."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.excepthandler, ast.match_case)):
            yield child
            yield from _statements(child)


def _imported(node: ast.Import | ast.ImportFrom, path: Path) -> set[str]:
    """Full names of the modules that a statement imports, and of what may be modules."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    parts = path.relative_to(SOURCE).parts[: -node.level] if node.level else ()
    module = ".".join([*parts, *filter(None, [node.module])])
    return {module, *(f"{module}.{alias.name}" for alias in node.names)}


def _files(name: str) -> list[Path]:
    """Files that importing a module of the package runs: its own and those of its parents."""
    parts = name.split(".")
    names = (".".join(parts[: k + 1]) for k in range(len(parts)))
    return [file for name in names if name not in UNCOUNTED and (file := _find(name))]


@cache
def _find(name: str) -> Path | None:
    base = SOURCE.joinpath(*name.split("."))
    for path in (base / "__init__.py", base.with_suffix(".py")):
        if path.is_file():
            return path
    return None


def _content(tree: ast.Module) -> str:
    """A module as text; where no name is bound twice, its imports and definitions sorted."""
    if not _binds_once(tree.body):
        return ast.dump(tree)
    movable, rest = [], []
    for node in tree.body:
        if isinstance(node, IMPORTS):
            node.names.sort(key=lambda alias: alias.name)
        (movable if isinstance(node, (*DEFINITIONS, *IMPORTS)) else rest).append(ast.dump(node))
    return "\n".join(sorted(movable) + rest)


def _binds_once(body: list[ast.stmt]) -> bool:
    """Whether the order of the definitions in a module's body cannot matter once it runs."""
    # `import a.b` and `import a.c` both bind a, to the same module
    packages = {
        alias.name.partition(".")[0]
        for node in body
        if isinstance(node, ast.Import)
        for alias in node.names
        if not alias.asname
    }
    bound = Counter([*packages, *(name for node in body for name in _bound(node))])
    return all(count == 1 for count in bound.values())


def _bound(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, DEFINITIONS):
        yield node.name
    elif isinstance(node, IMPORTS):
        yield from (
            alias.asname or alias.name
            for alias in node.names
            if alias.asname or isinstance(node, ast.ImportFrom)
        )
    else:
        for part in ast.walk(node):
            if isinstance(part, ast.Name) and not isinstance(part.ctx, ast.Load):
                yield part.id
            elif isinstance(part, (*DEFINITIONS, *IMPORTS)) and part is not node:
                yield from _bound(part)
