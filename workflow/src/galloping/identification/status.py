"""Status of an identified model, which follows from its findings alone."""

from collections.abc import Iterable

from galloping.identification.observations import Code, Finding, Severity

STATUSES = ("ok", "not identifiable", "approximate", "refused", "unjudged")


def status_of(findings: Iterable[Finding]) -> str:
    """Derive the status of a model, such as `ok` or `refused`, from all its findings.

    The status is 'refused' after a fault, and 'approximate' if the model is inexact. After a
    warning it is 'not identifiable', or 'approximate' if random forces move the system. Else it is
    'ok'.
    """
    findings = list(findings)
    severities = {each.severity for each in findings}
    if Severity.FAULT in severities:
        return "refused"
    if Severity.INEXACT in severities:
        return "approximate"
    if Severity.WARNING in severities:
        is_forced = any(each.code == Code.RANDOM_FORCES for each in findings)
        return "approximate" if is_forced else "not identifiable"
    return "ok"
