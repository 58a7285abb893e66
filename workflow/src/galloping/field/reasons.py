"""The reasons of a verdict without symbols, and what would help against each."""

import re

WIND = "the wind speed, recorded beside the motion (`--input`)"
PLACES = (
    "sensors at more places along the span, which tell its modes apart (`position` in a mapping)"
)
PARTS = r"parts of the recording .* do not share one model"  # of a reason
CLOCKS = "one clock for all sensors, and samples at regular times"
# Part of a reason: what it means, and what would help; those that weigh more first.
REASONS = (
    (r"clipped at", "A sensor's range ends below the motion: its largest samples are cut off.",
     "a sensor with a larger range"),
    (r"tells what accelerates", "The motion hardly stands out of the noise of the sensors, or "
     "random forces keep it up.", "a larger motion, or better sensors"),
    (r"^moved by random forces", "", "a longer recording: errors fall with the root of its length"),
    (r"random forces", "The motion is kept up by random forces, such as gusts or traffic, where "
     "the line by itself would come to rest: it is no galloping. The model "
     "of such motion does not follow this one.",
     "a longer recording of such motion; or one of galloping, or after a release"),
    (PARTS, "The line was not the same all through the recording, as where the wind changes or "
     "gusts.", f"a shorter stretch in a steady wind; or {WIND}"),
    (r"do not share one model", "The recordings are not of one line in one wind.",
     f"each wind by itself; or {WIND}"),
    (r"(as in|such as) gusts", "Forces that the model does not have acted on the line, such as "
     "gusts.", WIND),
    (r"forces besides the model act", "Forces that the model does not have acted on the line, such "
     "as those of further modes, or the sensor of an input erred.", PLACES),
    (r"more modes gallop", "More modes of the span gallop or swing than the model has.", PLACES),
    (r"delayed against|clock", "The sensors do not share one clock, or one of them lags.", CLOCKS),
    (r"is not the rate of|(?<!time )scale", "Two sensors contradict each other: the scale of "
     "one of them is off.", "a check of the scale and unit of each sensor"),
    (r"drifts", "A sensor drifts.", "a sensor whose zero holds still"),
    (r"noise grows with the signal", "The sensors err more where the motion is larger.",
     "a check of the sensors at large motions"),
    (r"has a line at|besides it there oscillates", "The line also moves at a frequency in which "
     "the model has no part, mostly that of a higher mode of the span.", PLACES),
    (r"times jitter", "What the model misses is largest where the line moves fastest, as where the "
     "times of the samples are not exact.", CLOCKS),
    (r"noise larger than it was said", "The sensors are noisier than was said, or terms are "
     "missing.", "the noise of the sensors, measured while the line is still"),
    (r"outliers", "Many samples lie far from those beside them.", "a check of the sensor"),
    (r"free of gaps|too few complete samples", "The recording has too many gaps.",
     "a recording without gaps for some ten periods"),
    (r"out of the noise|above its noise|more than noise", "The motion hardly stands out of the "
     "noise of the sensors.", "a larger motion, or better sensors"),
    (r"not measured", "Not all that moves was measured.",
     "displacements in both directions, beside what was measured"),
    (r"only repeats", "The recorded motion repeats itself all the time, and other equations have "
     "the same motion.", "a motion that grows or dies out over many periods, such as after a "
     "release"),
    (r"the data alone cannot tell", "Where the samples alone leave open which of two sets of terms "
     "is right, the simpler one was taken.", ""),
    (r"the data cannot tell|data alike|plausible|may be missing",
     "Several sets of terms explain the recording about equally well.",
     "a larger or smaller motion than the recorded one, that grows or dies out over many periods"),
    (r"not white|Hz more than", "The forces are not alike at all frequencies, or the line has a "
     "further mode.", PLACES),
    (r"diverge|no model found|predicts nothing|no oscillat|time scale|cannot be told",
     "No equations of this kind could be made to follow the recording.",
     "a longer recording of one steady motion; sensors in both directions"),
    (r"model inadequate", "The line also moves in a way that the model has no part in.", PLACES),
)  # fmt: skip
PROBLEMS = (  # part of what is wrong with samples, and what would help
    ("is the unit", "the right units: the recorded motion is none that a span has"),
    ("less than 10 periods", "a longer recording, of ten periods of the motion or more"),
    ("less than 10 samples", "a higher sampling rate, of ten samples in a period or more"),
    ("hardly more than noise", "a larger motion, or better sensors"),
    ("the mean drifts", "a sensor whose zero holds still"),
    ("clipped", "a sensor with a larger range"),
)


def plain_reasons(reason: str) -> list[tuple[str, str]]:
    """What the parts of a verdict's reason mean, and what would help; none where it has none."""
    fitting = [
        next((k for k, (pattern, *_) in enumerate(REASONS) if re.search(pattern, clause)), None)
        for clause in reason.split("; ")
    ]
    found = [REASONS[k][1:] for k in sorted(set(fitting) - {None})]
    return found[:-1] if len(found) > 1 and found[-1] == REASONS[-1][1:] else found
