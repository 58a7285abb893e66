"""The identification methods a study can name, without importing any of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

PROTOCOLS = ("derivative", "state", "displacement")
ALL_STATES = ("derivative", "state")
# Who reads each kind of evidence from its file, as `module:function`.
READERS = {
    "reduced": "galloping.identification.sparse.reduction:read",
    "recordings": "galloping.recording:read_replicates",
}


@dataclass(frozen=True)
class Method:
    """One way from a recording to a sparse model.

    function: `module:function`, imported only by the job that runs it. It takes one piece of
    evidence and the keywords `options`, and returns an `IdentifiedModel`.
    evidence: `reduced` (a Regression) or `recordings` (those of one replicate, which share one
    model).
    options: keys of the `identification` settings, `threshold` (its own, or
    None), `rng` (of the replicate) and `seed` (of the study).
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
    def reader(self) -> str:
        """Who reads the evidence."""
        return READERS[self.evidence]

    def settings(self, identification: Mapping, seed: int) -> dict:
        """What a job reads of the study's settings: editing those of another method changes none.

        identification: that section. seed: of the study. The options without `rng`, which the job
        makes from `seed` and the name of each replicate; no seed where the method draws nothing.
        """
        available = {
            **identification,
            "threshold": identification["thresholds"].get(self.name),
            "seed": seed,
        }
        return {
            "reader": self.reader,
            "function": self.function,
            "options": {key: available[key] for key in self.options if key != "rng"},
            "degree": identification["degree"],
            "seed": seed if "rng" in self.options else None,
        }


METHODS = (
    Method(
        name="stlsq",
        function="galloping.identification.sparse.stlsq:normalised",
        evidence="reduced",
        options=("threshold", "path_length"),
        protocols=ALL_STATES,
        needs_uniform=False,
        summary="sequentially thresholded least squares on normalised columns",
    ),
    Method(
        name="stlsq_raw",
        function="galloping.identification.sparse.stlsq:raw",
        evidence="reduced",
        options=("threshold", "path_length"),
        protocols=ALL_STATES,
        needs_uniform=False,
        summary="the same on columns as they are, as the paper most likely did",
    ),
    Method(
        name="lasso",
        function="galloping.identification.sparse.lasso:lasso",
        evidence="reduced",
        options=("threshold",),
        protocols=ALL_STATES,
        needs_uniform=False,
        summary="least squares with an l1 penalty",
    ),
    Method(
        name="ensemble",
        function="galloping.identification.sparse.ensemble:ensemble",
        evidence="reduced",
        options=("threshold", "path_length", "ensemble_models", "rng"),
        protocols=ALL_STATES,
        needs_uniform=False,
        summary="median of thresholded fits to bootstrap samples of the recording",
    ),
    Method(
        name="weak",
        function="galloping.identification.sparse.weak:weak",
        evidence="recordings",
        options=("degree", "threshold", "path_length", "weak", "seed"),
        protocols=("state",),
        needs_uniform=True,
        summary="weak form: integrals against test functions in place of derivatives",
    ),
    Method(
        name="weak_gls",
        function="galloping.identification.likelihood.methods:weak_gls",
        evidence="recordings",
        options=("degree",),
        protocols=("state", "displacement"),
        needs_uniform=False,
        summary="weak form by generalised least squares, with the kinematic identity as rows",
    ),
    Method(
        name="maximum_likelihood",
        function="galloping.identification.likelihood.methods:maximum_likelihood",
        evidence="recordings",
        options=("degree",),
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="multiple shooting with selection: the Cramer-Rao bound",
    ),
)
BY_NAME = {method.name: method for method in METHODS}
