"""What was noticed in recordings, in sentences."""

from collections.abc import Iterable, Iterator

import numpy as np

from galloping.identification.observations import Code, Finding
from galloping.identification.oscillations import EnvelopePart, FurtherMode
from galloping.intervals import NORMAL_95
from galloping.readers.units import meaning, plain_unit

SENTENCES = {
    Code.RELEASED: "Motion begins at {time_s:.5g} s, out of rest, which is left out.",
    Code.CAME_TO_REST: "After {time_s:.5g} s nothing moves that the sensors show: the rest is left "
    "out.",
    Code.KNOCKED: "At {time_s:.5g} s something struck, and changed the motion by {percent:.2g} %. "
    "The motion before and that after it are used, each with a start of its own.",
    Code.FORCE_STEPPED: "At {time_s:.5g} s a steady force changed: the position of rest moved by "
    "{change:.3g} {unit}. The motion before and that after it are used, each with a start of its "
    "own.",
    Code.FORCED_STEADILY: "{name} also swings steadily at {frequency_hz:.6g} Hz, by "
    "±{amplitude:.3g} {unit}, as what a machine drives, or the mains in a sensor: a force that was "
    "not recorded. Natural frequency and damping are those of the motion that dies out beside it.",
    Code.NOT_EXPONENTIAL: "Frequency and damping change with the amplitude, as no equation of the "
    "library has them. They are told by the envelope, as by the logarithmic decrement, for each "
    "amplitude; the equation has their means.",
}  # fmt: skip


def sentence_of(finding: Finding) -> str:
    """A finding in a sentence."""
    data = dict(finding.data)
    if "share" in data:
        data["percent"] = 100.0 * data["share"]
    name = meaning(finding.subject) or finding.subject
    text = SENTENCES[finding.code].format(
        name=f"The {name}" if name != finding.subject else name,
        unit=plain_unit(finding.subject) if finding.subject else "",
        **data,
    )
    return text.replace(" .", ".").replace(" ,", ",")


def sentences_of(
    findings: Iterable[Finding], further: Iterable[FurtherMode], of_model: Iterable[str]
) -> Iterator[str]:
    """What was noticed, and which modes swing beside the model, a sentence each.

    Parameters
    ----------
    findings : iterable of Finding
    further : iterable of FurtherMode
    of_model : iterable of str
        Names of the modes that are told with an interval.
    """
    yield from map(sentence_of, findings)
    told = set(of_model)
    names = dict.fromkeys(mode.name for mode in further if mode.name in told)
    if names:
        yield (
            f"Beside it swings {', and '.join(names)}: it is left out of the equations, and told "
            "by itself."
        )


def envelope_rows(parts: Iterable[EnvelopePart]) -> Iterator[str]:
    """Rows of a table: amplitude, frequency and damping, each with its 95 % interval."""
    for part in parts:
        hz = np.array([part.frequency, NORMAL_95 * part.frequency_error]) / (2.0 * np.pi)
        omega = np.hypot(part.frequency, part.growth)
        percent = 100.0 * np.array([-part.growth, NORMAL_95 * part.growth_error]) / omega
        amplitude = f"±{part.amplitude:.3g} {plain_unit(part.state)}".rstrip()
        yield (f"| {part.time:.4g} s | {amplitude} | {_within(*hz)} Hz | {_within(*percent)} % |")


def _within(value: float, half: float) -> str:
    digits = max(0, 1 - int(np.floor(np.log10(max(half, 1e-12)))))
    return f"{value:.{digits}f} ± {half:.{digits}f}"
