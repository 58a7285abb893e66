"""Identification methods that a study can name, without importing any of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from galloping.deferred import identification
from galloping.fields import Section, one_of, real, setting, whole
from galloping.recording.measurement import (
    ALL_STATES,
    DERIVATIVES,
    DISPLACEMENTS_ALONE,
    PROTOCOLS,
    RATES,
    Protocol,
)
from galloping.results import IDENTIFIED, KNOWN

if TYPE_CHECKING:
    Positive = float
    Length = int
    Count = int
    Kinematics = str
else:
    Positive = real(gt=0)
    Length, Count = whole(ge=5, le=1000), whole(ge=2, le=1000)
    Kinematics = one_of((IDENTIFIED, KNOWN))


class NoOptions(Section):
    """Settings of an identification method that has no options."""


class Thresholded(Section):
    """Settings of a method that drops terms below a threshold."""

    threshold: Positive | None = setting(
        None, "in the method's unit; null: chosen from the data for each equation", "1"
    )


class Scanned(Thresholded):
    """Settings of a method whose threshold is given, or chosen from several candidates."""

    path_length: Length = setting(30, "number of candidate thresholds, if the data choose", "1")


class Paper(Scanned):
    """Settings of the identification method that the paper used."""

    kinematics: Kinematics = setting(
        IDENTIFIED,
        "whether the equation dX/dt = dX of a displacement X is known, or identified as others are",
    )


class Ensemble(Scanned):
    """Settings of ensemble SINDy, which takes the median of many bagged models."""

    models: Count = setting(20, "number of bagged models in the ensemble", "1")


sparse = identification.sparse
likelihood = identification.likelihood.study_methods


@dataclass(frozen=True)
class Method:
    """Identification method of a study: its function, options and data requirements.

    family: the methods that share a job: imports, recordings, and evidence where it is the same.
    evidence: the function, as `deferred` names it, that prepares the data of the method from the
    recordings of one noise realisation, which share one model, and the terms of the library; None
    for the recordings themselves. function: named likewise, imported only by the job that runs it.
    Its arguments are the evidence of a realisation and the keywords `options`, and it returns an
    `IdentifiedModel`. options: its own section of the `identification` settings, keywords of the
    function. is_random: whether the function has a further keyword, `rng` of the realisation.
    by_default: whether a study has it that names none. takes: what a measurement setup may measure:
    DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE, RATES. needs_uniform: whether the samples must be
    equally spaced, unlike random subsets.
    """

    name: str
    function: str
    options: type[Section]
    family: str = "sparse"
    evidence: str | None = sparse.evidence.reduce
    takes: tuple[str, ...] = (DERIVATIVES, ALL_STATES)
    needs_uniform: bool = False
    is_random: bool = False
    by_default: bool = True

    @property
    def protocols(self) -> tuple[str, ...]:
        """Names of the measurement setups whose recordings the method can use."""
        return tuple(each.name for each in PROTOCOLS if each.measures in self.takes)

    @property
    def modules(self) -> tuple[str, ...]:
        """References `module:function` to the functions that a job of the method imports."""
        return tuple(filter(None, (self.evidence, self.function)))

    def can_use(self, protocol: Protocol, uniform: bool) -> bool:
        """Decide whether the method can use recordings of this measurement setup and sampling."""
        return protocol.measures in self.takes and (uniform or not self.needs_uniform)

    def settings(self, identification: Mapping, seed: int) -> dict:
        """Return the settings that a job of the method needs: functions, options and seed.

        An edit of the settings of another family changes none. identification: that section. seed:
        of the study. The options are without `rng`, which the job makes from `seed` and the name of
        each noise realisation; no seed if the method draws nothing.
        """
        return {
            "evidence": self.evidence,
            "function": self.function,
            "options": dict(identification.get(self.name, {})),
            "seed": seed if self.is_random else None,
        }


METHODS = (
    Method("paper", sparse.stlsq.fit_raw, Paper, evidence=sparse.evidence.reduce_by_splines),
    Method("stlsq", sparse.stlsq.fit_normalised, Scanned),
    # not run by default: where it was tried, no better than frols, at twenty times the cost
    Method("lasso", sparse.lasso.fit_lasso, Thresholded, by_default=False),
    Method("frols", sparse.frols.fit_frols, NoOptions),
    Method("ensemble", sparse.stlsq.fit_ensemble, Ensemble, is_random=True),
    Method(
        "weak", sparse.stlsq.fit_normalised, Scanned,
        evidence=sparse.evidence.reduce_weakly, takes=(ALL_STATES,), needs_uniform=True,
    ),
    Method(
        "weak_gls", likelihood.run_weak_gls, NoOptions,
        family="likelihood", evidence=likelihood.shared_evidence,
        takes=(ALL_STATES, DISPLACEMENTS_ALONE),
    ),
    Method(
        "maximum_likelihood", likelihood.run_maximum_likelihood, NoOptions,
        family="likelihood", evidence=likelihood.shared_evidence,
        takes=(DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE, RATES),
    ),
)  # fmt: skip
BY_NAME = {method.name: method for method in METHODS}
