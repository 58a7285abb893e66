"""One thread for linear algebra: on matrices as small as these, further threads only wait."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from threadpoolctl import threadpool_limits

Function = TypeVar("Function", bound=Callable)


def one_thread(function: Function) -> Function:
    """The function, with one thread for linear algebra until it ends; then the others are back."""
    return threadpool_limits.wrap(limits=1, user_api="blas")(function)
