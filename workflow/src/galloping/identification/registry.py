"""The identification methods a study can name, without importing any of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from galloping.fields import Section
from galloping.identification.options import Ensemble, NoOptions, Paper, Scanned, Thresholded
from galloping.measurement import protocols
from galloping.measurement.protocols import (
    ALL_STATES,
    DERIVATIVES,
    DISPLACEMENTS_ALONE,
    RATES,
    Protocol,
)

REGRESSION = "galloping.identification.sparse.evidence:reduce"
WEAK_FORM = "galloping.identification.sparse.evidence:reduce_weakly"
START = "galloping.identification.likelihood.methods:start"


@dataclass(frozen=True)
class Method:
    """One way from a recording to a sparse model.

    family: the methods that share a job: imports, recordings, and evidence where it is the same.
    evidence: `module:function` of what it works on, made of the recordings of one replicate, which
    share one model, and the terms of the library; None for the recordings themselves.
    function: `module:function`, imported only by the job that runs it. It takes the evidence of a
    replicate and the keywords `options`, and returns an `IdentifiedModel`.
    options: its own section of the `identification` settings, keywords of the function. given:
    further keywords: `degree` of the library, `seed` of the study, `rng` of the replicate.
    by_default: whether a study has it that names none.
    takes: what a protocol may measure: DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE, RATES.
    needs_uniform: whether the samples must be equally spaced, which random subsets are not.
    """

    name: str
    family: str
    evidence: str | None
    function: str
    options: type[Section]
    takes: tuple[str, ...]
    needs_uniform: bool
    given: tuple[str, ...] = ()
    by_default: bool = True

    @property
    def protocols(self) -> tuple[str, ...]:
        """Names of the protocols whose recordings it can use."""
        return tuple(each.name for each in protocols.PROTOCOLS if each.measures in self.takes)

    @property
    def modules(self) -> tuple[str, ...]:
        """What a job imports by name to run it."""
        return tuple(filter(None, (self.evidence, self.function)))

    def can_use(self, protocol: Protocol, uniform: bool) -> bool:
        """Whether it can use recordings by a protocol, of equally spaced samples or not."""
        return protocol.measures in self.takes and (uniform or not self.needs_uniform)

    def settings(self, identification: Mapping, seed: int) -> dict:
        """What a job reads of the study's settings: editing those of another family changes none.

        identification: that section. seed: of the study. The options without `rng`, which the job
        makes from `seed` and the name of each replicate; no seed where the method draws nothing.
        """
        available = {"degree": identification["degree"], "seed": seed}
        given = {key: available[key] for key in self.given if key != "rng"}
        return {
            "evidence": self.evidence,
            "function": self.function,
            "options": {**identification.get(self.name, {}), **given},
            "seed": seed if "rng" in self.given else None,
        }


METHODS = (
    Method(
        name="paper",
        family="sparse",
        evidence=REGRESSION,
        function="galloping.identification.sparse.stlsq:raw",
        options=Paper,
        takes=(DERIVATIVES, ALL_STATES),
        needs_uniform=False,
    ),
    Method(
        name="stlsq",
        family="sparse",
        evidence=REGRESSION,
        function="galloping.identification.sparse.stlsq:normalised",
        options=Scanned,
        takes=(DERIVATIVES, ALL_STATES),
        needs_uniform=False,
    ),
    Method(
        name="lasso",
        family="sparse",
        evidence=REGRESSION,
        function="galloping.identification.sparse.lasso:lasso",
        options=Thresholded,
        takes=(DERIVATIVES, ALL_STATES),
        needs_uniform=False,
        by_default=False,  # no better than frols where it was tried, at twenty times the cost
    ),
    Method(
        name="frols",
        family="sparse",
        evidence=REGRESSION,
        function="galloping.identification.sparse.frols:frols",
        options=NoOptions,
        takes=(DERIVATIVES, ALL_STATES),
        needs_uniform=False,
    ),
    Method(
        name="ensemble",
        family="sparse",
        evidence=REGRESSION,
        function="galloping.identification.sparse.stlsq:ensemble",
        options=Ensemble,
        given=("rng",),
        takes=(DERIVATIVES, ALL_STATES),
        needs_uniform=False,
    ),
    Method(
        name="weak",
        family="sparse",
        evidence=WEAK_FORM,
        function="galloping.identification.sparse.stlsq:normalised",
        options=Scanned,
        takes=(ALL_STATES,),
        needs_uniform=True,
    ),
    Method(
        name="weak_gls",
        family="likelihood",
        evidence=START,
        function="galloping.identification.likelihood.methods:by_weak_gls",
        options=NoOptions,
        takes=(ALL_STATES, DISPLACEMENTS_ALONE),
        needs_uniform=False,
    ),
    Method(
        name="maximum_likelihood",
        family="likelihood",
        evidence=START,
        function="galloping.identification.likelihood.methods:by_maximum_likelihood",
        options=NoOptions,
        takes=(DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE, RATES),
        needs_uniform=False,
    ),
)
BY_NAME = {method.name: method for method in METHODS}
