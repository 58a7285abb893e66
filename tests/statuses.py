"""A finding for each status of a model."""

from galloping.identification.findings import Code, Finding, Severity

SEVERITIES = {
    "ok": Severity.NOTE,
    "not identifiable": Severity.WARNING,
    "approximate": Severity.INEXACT,
    "refused": Severity.FAULT,
}


def finding_for(status: str) -> Finding:
    """A finding from which a status follows, if no other is more severe."""
    return Finding(Code.NO_TERM, SEVERITIES[status])
