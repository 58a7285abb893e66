"""What identification notices in recordings, as values: a code with its data, and no sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from galloping.arrays import Immutable


class Severity(StrEnum):
    """What a finding means for the model."""

    NOTE = "note"  # the model holds
    WARNING = "warning"  # the model holds, within limits that the finding names
    FAULT = "fault"  # no model can be trusted


class Code(StrEnum):
    """Kinds of findings, each with the keys of its data. Times are in s on a recording's clock."""

    RELEASED = "released"  # from_s, time_s: at rest from one to the other, where motion begins
    CAME_TO_REST = "came_to_rest"  # time_s, until_s
    KNOCKED = "knocked"  # time_s, share: the change of the motion, in units of its amplitude
    FORCE_STEPPED = "force_stepped"  # time_s, change: of the position of rest, in its unit
    FORCED_STEADILY = "forced_steadily"  # frequency_hz, frequency_error_hz, amplitude
    NOT_EXPONENTIAL = "not_exponential"  # the model is the mean of `IdentifiedModel.envelope`


@dataclass(frozen=True, eq=False)
class Finding(Immutable):
    """Something that was noticed in a recording.

    Parameters
    ----------
    code : Code
    severity : Severity
    subject : str
        The state or channel that shows it, '' if all do.
    data : mapping of str to float
        By the names that `Code` lists.
    recording : int
        Index among the recordings as they were given.
    """

    code: Code
    severity: Severity
    subject: str = ""
    data: Mapping[str, float] = field(default_factory=dict)
    recording: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "code", Code(self.code))
        object.__setattr__(self, "severity", Severity(self.severity))
        super().__post_init__()

    def as_dict(self) -> dict[str, object]:
        """The arguments of the finding as plain values."""
        return {
            "code": self.code.value, "severity": self.severity.value, "subject": self.subject,
            "data": dict(self.data), "recording": self.recording,
        }  # fmt: skip
