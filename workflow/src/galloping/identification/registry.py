"""The identification methods a study can name, without importing any of them."""

from __future__ import annotations

from dataclasses import dataclass

PROTOCOLS = ("derivative", "state")


@dataclass(frozen=True)
class Method:
    """One way from a recording to a sparse model.

    function: `module:function`, imported only by the job that runs it. It takes one piece of
    evidence and the keywords `options`, and returns an `Identified`.
    evidence: `reduced` (a Regression) or `recordings` (a Recording).
    options: keys of the `identification` settings, `threshold` (its own, or None) and `rng`.
    protocols: the measurement protocols whose recordings it can use.
    needs_uniform: whether the samples must be equally spaced, which random subsets are not.
    """

    name: str
    function: str
    evidence: str
    options: tuple[str, ...]
    protocols: tuple[str, ...]
    needs_uniform: bool
    summary: str

    @property
    def module(self) -> str:
        """Where the function lives."""
        return self.function.partition(":")[0]


METHODS = (
    Method(
        name="stlsq",
        function="galloping.identification.stlsq:normalised",
        evidence="reduced",
        options=("threshold", "path_length"),
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="sequentially thresholded least squares on normalised columns",
    ),
    Method(
        name="stlsq_raw",
        function="galloping.identification.stlsq:raw",
        evidence="reduced",
        options=("threshold", "path_length"),
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="the same on columns as they are, as the paper most likely did",
    ),
    Method(
        name="lasso",
        function="galloping.identification.lasso:lasso",
        evidence="reduced",
        options=("threshold",),
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="least squares with an l1 penalty",
    ),
    Method(
        name="ensemble",
        function="galloping.identification.ensemble:ensemble",
        evidence="reduced",
        options=("threshold", "path_length", "ensemble_models", "rng"),
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="median of thresholded fits to bootstrap samples of the recording",
    ),
    Method(
        name="weak",
        function="galloping.identification.weak:weak",
        evidence="recordings",
        options=("degree", "threshold", "path_length", "weak", "rng"),
        protocols=("state",),
        needs_uniform=True,
        summary="weak form: integrals against test functions in place of derivatives",
    ),
)
BY_NAME = {method.name: method for method in METHODS}
