"""Failures of a search: errors with a finding, and a value instead of a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ParamSpec, Self, TypeVar

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.sentences import sentence_of


class NoModelError(Exception):
    """Error that a search gives no model, with the finding that explains why."""

    def __init__(self, code: Code, subject: str = "", **data: float | str) -> None:
        self.finding = Finding.of(code, subject, **data)
        super().__init__(sentence_of(self.finding))

    @classmethod
    def from_finding(cls, finding: Finding) -> Self:
        """Make an error of this class from the finding of another error."""
        return cls(finding.code, finding.subject, **finding.data)


class IdentificationError(NoModelError, ValueError):
    """Error that recordings permit no model: a valid result, not a mistake in a call."""


class NotConvergedError(NoModelError, FloatingPointError):
    """Error that a numerical search ended without converging to a solution."""


# Errors that mean that there is no model: `IdentificationError`, and the errors of numerics if a
# solution diverges, or numpy cannot factor or invert a matrix. Any other ValueError is a mistake in
# the code.
NO_MODEL_ERRORS = (IdentificationError, FloatingPointError, np.linalg.LinAlgError)
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True)
class NoModel:
    """Result of a search that found no model: the findings that explain why."""

    findings: tuple[Finding, ...] = ()
    lacks_useful_forecast = True  # as `IdentifiedModel.lacks_useful_forecast`


def attempt(
    search: Callable[Arguments, Result], *args: Arguments.args, **options: Arguments.kwargs
) -> Result | NoModel:
    """Run a search for a model and return its result, or `NoModel` for one of NO_MODEL_ERRORS."""
    try:
        return search(*args, **options)
    except NO_MODEL_ERRORS as error:
        return NoModel((as_finding(error),))


def as_finding(error: Exception) -> Finding:
    """Convert the error of a failed search for a model, one of NO_MODEL_ERRORS, to a finding."""
    if isinstance(error, NoModelError):
        return error.finding
    lines = str(error).splitlines() or [type(error).__name__]
    return Finding.of(Code.COMPUTATION_FAILED, error=lines[0])
