"""The identification methods a study can name, without importing any of them."""

from __future__ import annotations

from dataclasses import dataclass

PROTOCOLS = ("derivative", "state")


@dataclass(frozen=True)
class Method:
    """One way from a recording to a sparse model.

    module: where it lives, imported only by the job that runs it.
    protocols: the measurement protocols whose recordings it can use.
    needs_uniform: whether the samples must be equally spaced, which random subsets are not.
    """

    name: str
    module: str
    protocols: tuple[str, ...]
    needs_uniform: bool
    summary: str


METHODS = (
    Method(
        name="stlsq",
        module="galloping.identification.stlsq",
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="sequentially thresholded least squares on normalised columns",
    ),
    Method(
        name="stlsq_raw",
        module="galloping.identification.stlsq",
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="the same on columns as they are, as the paper most likely did",
    ),
    Method(
        name="lasso",
        module="galloping.identification.lasso",
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="least squares with an l1 penalty",
    ),
    Method(
        name="ensemble",
        module="galloping.identification.ensemble",
        protocols=PROTOCOLS,
        needs_uniform=False,
        summary="median of thresholded fits to bootstrap samples of the recording",
    ),
    Method(
        name="weak",
        module="galloping.identification.weak",
        protocols=("state",),
        needs_uniform=True,
        summary="weak form: integrals against test functions in place of derivatives",
    ),
)
