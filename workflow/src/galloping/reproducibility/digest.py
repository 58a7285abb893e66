"""Digest of the code a script runs, so that Snakemake reruns what an edit touches.

Snakemake tracks a rule's script but not the modules it imports. The digest covers the script's
imports from this package, transitively, without comments, docstrings and layout.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[2]
PACKAGE = Path(__file__).parents[1].name


def code_digest(*roots: str | Path) -> str:
    """Hex digest of the package modules that `roots` use.

    roots: script files, or dotted names of modules that are imported by name at run time.
    """
    modules: set[Path] = set()
    for root in roots:
        path = Path(root) if Path(root).suffix == ".py" else _find(str(root))
        if path is None:
            raise ValueError(f"{root}: no such module")
        modules |= _closure(path)
    content = hashlib.sha256()
    for path in sorted(modules):
        if path.is_relative_to(SOURCE):
            content.update(f"{path.relative_to(SOURCE)}\n{_parse(path)[0]}\n".encode())
    return content.hexdigest()[:16]


def _closure(root: Path) -> set[Path]:
    seen, waiting = set(), [root]
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen.add(path)
            waiting += _parse(path)[1]
    return seen


@cache
def _parse(path: Path) -> tuple[str, list[Path]]:
    """A module's code without docstrings, and the package files that it imports."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_docstring(body[0]):
            del body[0]
    parts = {
        ".".join(name.split(".")[: k + 1])
        for name in names
        if name.split(".")[0] == PACKAGE
        for k in range(len(name.split(".")))
    }
    return ast.dump(tree), [found for part in sorted(parts) if (found := _find(part))]


def _is_docstring(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _find(name: str) -> Path | None:
    base = SOURCE.joinpath(*name.split("."))
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.is_file():
            return path
    return None
