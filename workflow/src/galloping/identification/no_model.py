"""Failures of a search: errors with findings, and a value instead of a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.sentences import sentence_of


class NoModelError(Exception):
    """Error that a search gives no model, with the findings that explain why."""

    def __init__(self, *findings: Finding) -> None:
        self.findings = findings
        super().__init__(*map(sentence_of, findings))


class IdentificationError(NoModelError, ValueError):
    """Error that recordings permit no model: a valid result, not a mistake in a call."""

    def __init__(self, code: Code, subject: str = "", **data: float | str) -> None:
        super().__init__(Finding.of(code, subject, **data))


class NotConvergedError(NoModelError, FloatingPointError):
    """Error that a numerical search ended without converging to a solution."""


# Errors that mean that there is no model: `NoModelError`, and the errors of numerics if a solution
# diverges, or numpy cannot factor or invert a matrix. Any other ValueError is a mistake in the
# code.
NO_MODEL_ERRORS = (NoModelError, FloatingPointError, np.linalg.LinAlgError)
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
        return NoModel(as_findings(error))


def as_findings(error: Exception) -> tuple[Finding, ...]:
    """Convert the error of a failed search for a model, one of NO_MODEL_ERRORS, to findings."""
    if isinstance(error, NoModelError):
        return error.findings
    lines = str(error).splitlines() or [type(error).__name__]
    return (Finding.of(Code.COMPUTATION_FAILED, error=lines[0]),)
