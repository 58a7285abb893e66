"""Functions by name: what a registry lists without importing it."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module


def imported(path: str) -> Callable:
    """The function `module:function`, imported only now."""
    module, _, function = path.partition(":")
    return getattr(import_module(module), function)
