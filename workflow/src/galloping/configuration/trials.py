"""The settings of trials of what the identification claims."""

from __future__ import annotations

from pydantic import model_validator

from galloping.configuration.fields import (
    NoiseLevel,
    Section,
    invalid,
    one_of,
    real,
    selection,
    setting,
    show,
    whole,
)
from galloping.identification.registry import METHODS, PROTOCOL_NAMES
from galloping.trials.registry import KINDS, LONGEST

ProtocolName = one_of(PROTOCOL_NAMES)
MethodName = one_of(tuple(method.name for method in METHODS))


class TrialSection(Section):
    """Fits to many recordings whose truth is known."""

    kind: one_of(tuple(KINDS)) = setting("random_lines", "what is recorded and identified")
    seed: whole(ge=0) = setting(0, "seed from which lines, faults and noise are drawn", "1")
    replicates: whole(ge=1, le=100_000) = setting(
        20, "recordings of each case and cell, or random lines", "1"
    )
    batch: whole(ge=1) = setting(10, "replicates of a case that one job makes", "1")
    cases: selection(str) | None = setting(None, "lines, faults or systems, all by default")
    methods: selection(MethodName) | None = setting(
        None, "identification methods; by default ours, of systems beside those that it is to beat"
    )
    protocols: selection(ProtocolName) | None = setting(
        None, "what is measured", rule="of `default_line` and `random_lines`"
    )
    levels: selection(NoiseLevel) | None = setting(
        None, "noise levels, in standard deviations of each state", "1"
    )
    samples: selection(whole(ge=100)) | None = setting(
        None, "lengths of the recordings", "samples", rule="of `systems` and `published_intervals`"
    )
    durations: selection(real(ge=1)) | None = setting(
        None, "lengths of the recordings", "s", rule="of `published_terms`"
    )

    @model_validator(mode="after")
    def _of_its_kind(self) -> TrialSection:
        kind = KINDS[self.kind]
        for key in ("protocols", "levels", "samples", "durations"):
            if getattr(self, key) is not None and key not in kind.options:
                taken = ", ".join(kind.options) or "none"
                raise invalid(f"is no key of {self.kind}; its own keys: {taken}", key)
        for case in self.cases or ():
            if case not in kind.cases:
                raise invalid(
                    f"unknown case {show(case)} of {self.kind}; allowed: {', '.join(kind.cases)}",
                    "cases",
                )
        for duration in self.durations or ():
            for case in self.cases or kind.cases:
                if duration > LONGEST[case]:
                    raise invalid(
                        f"{duration:g} is not allowed; of {case} at most {LONGEST[case]:g}",
                        "durations",
                    )
        return self
