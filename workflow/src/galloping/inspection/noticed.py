"""Sentences for the user on further modes, and on findings that do not affect the status."""

from collections.abc import Iterable, Iterator

import numpy as np

from galloping.identification.findings import Finding
from galloping.identification.oscillations import EnvelopePart, FurtherMode
from galloping.identification.sentences import explain, join_words
from galloping.model.intervals import NORMAL_95
from galloping.readers.units import meaning, plain_unit


def write_sentences(
    findings: Iterable[Finding], further: Iterable[FurtherMode] = (), of_model: Iterable[str] = ()
) -> Iterator[str]:
    """Yield sentences on findings that do not affect a model's status, and on unmodelled modes.

    findings: those that affect the status are ignored. further: modes of the recording for which
    the model has no coordinate. of_model: names of the modes that are listed with an interval.
    """
    findings = list(findings)
    units = {each.subject: _name_and_unit(each.subject) for each in findings}
    yield from (meaning for meaning, _ in explain(findings, False, units=units))
    listed = set(of_model)
    names = dict.fromkeys(mode.name for mode in further if mode.name in listed)
    if names:
        them = "them" if len(names) > 1 else "it"
        yield (
            f"The recording also contains {join_words(names)}. The equations do not include "
            f"{them}; the table does."
        )


def _name_and_unit(subject: str) -> tuple[str, str]:
    name = meaning(subject)
    return f"The {name}" if name else subject, plain_unit(subject) if subject else ""


def envelope_rows(parts: Iterable[EnvelopePart]) -> Iterator[str]:
    """Yield table rows of amplitude, frequency and damping, the latter two with 95 % intervals."""
    for part in parts:
        hz = np.array([part.frequency, NORMAL_95 * part.frequency_error]) / (2.0 * np.pi)
        omega = np.hypot(part.frequency, part.growth)
        percent = 100.0 * np.array([-part.growth, NORMAL_95 * part.growth_error]) / omega
        amplitude = f"±{part.amplitude:.3g} {plain_unit(part.state)}".rstrip()
        yield (
            f"| {part.time:.4g} s | {amplitude} | {_format_interval(*hz)} Hz "
            f"| {_format_interval(*percent)} % |"
        )


def _format_interval(value: float, half: float) -> str:
    digits = max(0, 1 - int(np.floor(np.log10(max(half, 1e-12)))))
    return f"{value:.{digits}f} ± {half:.{digits}f}"
