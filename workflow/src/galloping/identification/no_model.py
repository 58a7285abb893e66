"""Failures of a search: errors with a finding, and a value instead of a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np

from galloping.identification.observations import Code, Finding
from galloping.identification.sentences import sentence_of


class NoModelError(Exception):
    """Error with the finding because of which a search gives no model."""

    def __init__(self, code: Code, subject: str = "", **data: float | str) -> None:
        self.finding = Finding.of(code, subject, **data)
        super().__init__(sentence_of(self.finding))

    @classmethod
    def from_finding(cls, finding: Finding) -> Self:
        """Make an error from the finding of an earlier one."""
        return cls(finding.code, finding.subject, **finding.data)


class IdentificationError(NoModelError, ValueError):
    """Error of recordings that give no model: a result, not a mistake in a call."""


class NotConvergedError(NoModelError, FloatingPointError):
    """Error of a numerical search that ended without a solution."""


# `IdentificationError`, and what numerics raise where there is no model: a solution diverges, or
# numpy cannot factor or invert a matrix. Any other ValueError is a mistake in the code.
NO_MODEL = (IdentificationError, FloatingPointError, np.linalg.LinAlgError)
Result = TypeVar("Result")


@dataclass(frozen=True)
class NoModel:
    """Result of a search without a model: the reasons."""

    findings: tuple[Finding, ...] = ()
    tells_little = True  # as of an `IdentifiedModel`


def attempt(search: Callable[[], Result]) -> Result | NoModel:
    """Run a search; `NoModel` if it raises one of NO_MODEL."""
    try:
        return search()
    except NO_MODEL as error:
        return NoModel((as_finding(error),))


def as_finding(error: Exception) -> Finding:
    """Convert an error of NO_MODEL to a finding."""
    if isinstance(error, NoModelError):
        return error.finding
    lines = str(error).splitlines() or [type(error).__name__]
    return Finding.of(Code.COMPUTATION_FAILED, error=lines[0])
