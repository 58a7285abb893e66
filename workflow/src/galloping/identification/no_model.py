"""Why a search leads to no model: errors with a finding, and the value that stands for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np

from galloping.identification.observations import Code, Finding
from galloping.identification.sentences import sentence_of


class NoModelError(Exception):
    """A finding because of which a search gives no model."""

    def __init__(self, code: Code, subject: str = "", **data: float | str) -> None:
        self.finding = Finding.of(code, subject, **data)
        super().__init__(sentence_of(self.finding))

    @classmethod
    def from_finding(cls, finding: Finding) -> Self:
        """Make an error of what an earlier one said."""
        return cls(finding.code, finding.subject, **finding.data)


class IdentificationError(NoModelError, ValueError):
    """Why recordings give no model: an answer, not a mistake in a call."""


class NotConvergedError(NoModelError, FloatingPointError):
    """Why a numerical search ended without a solution."""


# `IdentificationError`, and what numerics raise where there is no model: a solution diverges, or
# numpy cannot factor or invert a matrix. Any other ValueError is a mistake in the code.
NO_MODEL = (IdentificationError, FloatingPointError, np.linalg.LinAlgError)
Result = TypeVar("Result")


@dataclass(frozen=True)
class NoModel:
    """What a search returns that leads to no model: why it does not."""

    findings: tuple[Finding, ...] = ()
    tells_little = True  # as of an `IdentifiedModel`


def attempt(search: Callable[[], Result]) -> Result | NoModel:
    """Run a search; `NoModel` if it raises one of NO_MODEL."""
    try:
        return search()
    except NO_MODEL as error:
        return NoModel((as_finding(error),))


def as_finding(error: Exception) -> Finding:
    """Return what an error of NO_MODEL says."""
    if isinstance(error, NoModelError):
        return error.finding
    lines = str(error).splitlines() or [type(error).__name__]
    return Finding.of(Code.COMPUTATION_FAILED, error=lines[0])
