"""Text of findings, by `findings.csv`: the only place where findings become sentences."""

import re
from collections.abc import Iterable, Mapping

from galloping.identification.findings import Code, Finding, Severity, finding_kinds


def sentence_of(finding: Finding) -> str:
    """Return a finding as one technical sentence; '' if it does not affect the model's status."""
    return _fill_template(finding_kinds()[finding.code].sentence, 0, _template_values(finding))


def reason_of(findings: Iterable[Finding]) -> str:
    """Join the technical sentences on all findings into one text, the most important first."""
    return " ".join(filter(None, dict.fromkeys(map(sentence_of, _sort_by_weight(findings)))))


def explain(
    findings: Iterable[Finding],
    is_verdict: bool,
    is_span: bool = True,
    words: Mapping[str, str] | None = None,
    units: Mapping[str, tuple[str, str]] | None = None,
) -> list[tuple[str, str]]:
    """Return texts that explain findings to an engineer, each with advice.

    is_verdict: whether to explain the findings that affect the status, or the others. is_span:
    whether to use the phrases in <> of `findings.csv` before a bar, or those behind it. words:
    phrases that several rows share, by their names there. units: name and unit of each subject.
    Returns pairs of meaning and advice, either of which may be ''. Two meanings, that the model is
    inadequate and that no equations were found, are used if there is no other.
    """
    side, texts = 0 if is_span else 1, list[tuple[str, str]]()
    for finding in _sort_by_weight(findings) if is_verdict else findings:
        kind = finding_kinds()[finding.code]
        if bool(kind.sentence) != is_verdict:
            continue
        name, unit = (units or {}).get(finding.subject, (finding.subject, ""))
        values = _template_values(finding) | {"name": name, "unit": finding.data.get("unit", unit)}
        values |= words or {}
        # a fault without advice has a sentence that anyone understands
        is_plain = finding.severity == Severity.FAULT and not kind.advice
        template = kind.meaning or (kind.sentence if is_plain else "")
        meaning = _fill_template(template, side, values)
        texts.append((meaning, _fill_template(kind.advice, side, values)))
    distinct = [pair for pair in dict.fromkeys(texts) if any(pair)]
    least = [finding_kinds()[code].meaning for code in (Code.RESIDUAL_POWER, Code.NOT_FOLLOWED)]
    return [pair for pair in distinct if pair[0] not in least] or distinct


def join_words(parts: Iterable[str]) -> str:
    """Join texts to a list in words, such as `a, b and c`."""
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def _fill_template(template: str, side: int, values: Mapping[str, object]) -> str:
    """Fill in a template. side: which of the two phrases in <> is used."""
    text = re.sub("<(.*?)>", lambda match: f"{match[1]}|".split("|")[side], template)
    filled = text.format_map(values).replace(" .", ".").replace(" ,", ",")
    return re.sub(r"(?<=\d)%", " %", filled)


class _Unknown:
    """Number that was not determined, formatted as a word."""

    def __format__(self, specification: str) -> str:
        return "unknown"


def _sort_by_weight(findings: Iterable[Finding]) -> list[Finding]:
    codes = list(Code)  # the most important first
    return sorted(findings, key=lambda finding: codes.index(finding.code))


def _template_values(finding: Finding) -> dict[str, object]:
    """Collect the values of templates: subject, data, and shares in percent and in words."""
    values: dict[str, object] = {"subject": finding.subject, **finding.data}
    values |= {name: _Unknown() for name, value in finding.data.items() if value != value}
    if "share" in finding.data:
        share = float(finding.data["share"])
        values["share_percent"] = 100.0 * share
        large = "all of" if share < 2.0 else "many times"
        values["share_in_words"] = f"{100.0 * share:.0f} % of" if share < 1.0 else large
    return values
