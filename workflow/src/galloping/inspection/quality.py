"""Quality of a recording before any identification: sampling, gaps, noise, spectrum."""

from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander
from scipy.ndimage import maximum_filter1d, median_filter

from galloping.arrays import TIME_ROUNDING, round_down, round_up
from galloping.identification.findings import Code, Finding
from galloping.identification.free_motion.rest import moving_samples
from galloping.identification.preparation.screening import find_saturated_values
from galloping.identification.sentences import sentence_of
from galloping.inspection.noticed import write_sentences
from galloping.readers.units import state_unit
from galloping.recording.samples import sampling_step

if TYPE_CHECKING:
    from galloping.readers.mapping import ColumnMapping, InputColumn
    from galloping.readers.series import Series

MEDIAN_SAMPLES = 5  # number of samples of a running median
MIN_JUMP = 0.05  # smallest jump, relative to the range of a channel
JUMP_REACH = 16  # range on each side in which a jump exceeds recurring changes, in quarter periods
OUTLIER_DEVIATION = 8.0  # distance from the running median, in noise deviations: chance 1e-15
MIN_REPORTED_GAP = 3.0  # shortest gap, in median steps: longer than any jitter
MIN_CLIPPED_SAMPLES = 5  # smallest number of equal samples in a row at an end of the range
MIN_PERIODS = 10  # smallest number of periods that determine the damping
MIN_SAMPLES_PER_PERIOD = 10  # smallest number of samples that distinguish motion from noise
MIN_SPLIT_GAP = 0.02  # shortest gap that splits a spectrum, relative to the time with samples
MAX_MISSING_SHARE = 0.1  # largest share of the time of other columns in gaps of a channel
MIN_DISTINCT_VALUES = 32  # smallest number of values that resolve a tenth of the deviation
MIN_SIGNAL_TO_NOISE = 3.0  # smallest ratio of motion to noise that determines terms
# Smallest power of a peak at five adjacent frequencies, relative to white noise of the same median
# power. White noise itself does not reach half of it.
MIN_PEAK = 20.0
MIN_RECURRENCE = 0.6  # smallest correlation of a recurrent motion with itself after a period
MAX_LAG = 1.6  # longest lag of this correlation, in periods
# Largest variance of the difference of two channels that show the same motion, relative to their
# noise, whose variance is known to a few percent.
MAX_VARIANCE_RATIO = 1.3
MAX_ACCELERATION_CORRELATION = 0.5  # largest correlation of a displacement and its acceleration
MAX_HORIZONTAL_RATIO = 10.0  # largest ratio of horizontal to vertical motion of a line
# Smallest and largest difference of the highest and lowest sample of a span, by unit. Beyond, the
# unit is most likely wrong.
PLAUSIBLE_RANGES = {"m": (0.005, 50.0), "m/s": (0.005, 100.0), "m/s^2": (0.005, 1000.0)}
PLAUSIBLE_FREQUENCIES = 0.02, 20.0  # range of galloping and of other large motion, Hz


def inspect_recording(series: "Series", mapping: "ColumnMapping") -> dict:
    """Inspect the quality of a recording: sampling, gaps, noise, spectra and likely faults.

    The report has `sampling`, `channels` and `inputs` by column, `problems` and `notes`. Its values
    are plain. A problem names its column, the row in the file where it begins, its code with data,
    and a description. Frequencies in Hz, times in s, values in SI units.
    """
    time = series.time
    sampled = np.flatnonzero(np.isfinite(series.values).any(axis=1))
    begins, steps = time[sampled], np.diff(time[sampled])
    step = sampling_step(time, series.values)
    gaps = np.flatnonzero(steps > MIN_REPORTED_GAP * step)
    report: dict[str, Any] = {
        "file": series.path.name,
        "start": series.start,
        "sampling": {
            "samples": len(sampled),
            "duration_s": float(time[-1] - time[0]),
            "sampled_s": sampled_time(begins, step),
            "rate_hz": 1.0 / step,
            "irregularity_percent": float(
                100 * np.std(steps[steps <= MIN_REPORTED_GAP * step]) / step
            ),
            "gaps": [
                {
                    "row": int(series.rows[sampled[k]]),
                    "from_s": float(begins[k]),
                    "length_s": float(steps[k]),
                }
                for k in gaps[np.argsort(-steps[gaps])][:20]
            ],
            "gaps_total": len(gaps),
        },
        "channels": {},
        "problems": [],
        "notes": list(series.notes),
    }
    moves, rests = moving_samples(time, series.values)
    report["notes"] += write_sentences(rests)
    for channel, values in zip(mapping.channels, series.values.T, strict=True):
        unit = state_unit(channel.measures) if channel.scale == "known" else "1"
        _, is_rate = mapping.target(channel)
        moving = time[moves], values[moves], step, series.rows[moves]  # rest is no fault
        described, problems = _inspect_channel(*moving, unit, is_rate)
        sensor = {"measures": channel.measures, "position_m": channel.position}
        report["channels"][channel.column] = sensor | described
        report["problems"] += [
            _make_problem(row, code, channel.column, **data) for row, code, data in problems
        ]
    report["problems"] += _find_short_channels(series, mapping, report)
    report["problems"] += _find_copies(series, mapping, report["channels"])
    report["problems"] += _find_mix_ups(series, mapping, report["channels"])
    report["inputs"] = {one.column: _describe_input(series, one) for one in mapping.inputs}
    return report


def _make_problem(row: int, code: Code, column: str, **data: Any) -> dict:
    finding = Finding.of(code, column, **data)
    details = {key: finding.as_dict()[key] for key in ("code", "data")}
    return {"column": column, "row": int(row), **details, "what": sentence_of(finding)}


def make_finding(problem: dict) -> Finding:
    """Convert a problem listed in a quality report to a finding on its column."""
    return Finding.of(Code(problem["code"]), problem["column"], **problem["data"])


def _find_short_channels(series: "Series", mapping: "ColumnMapping", report: dict) -> list[dict]:
    """List problems of channels with fewer than MIN_PERIODS of their motion.

    A motion that does not recur, such as that in gusts, is ignored if another channel has as many
    periods. A change of the mean is reported separately.
    """
    moving_columns = {one["column"] for one in report["problems"] if one["code"] == Code.MEAN_MOVES}
    few, enough, least = {}, False, MIN_PERIODS * (1.0 - TIME_ROUNDING)
    for channel, values in zip(mapping.channels, series.values.T, strict=True):
        is_finite = np.isfinite(values)
        frequencies = report["channels"][channel.column]["dominant_frequencies_hz"]
        periods = sampled_time(series.time[is_finite]) * np.array(frequencies)
        enough |= bool(np.any(periods >= least))
        if len(periods) and periods[0] < least and channel.column not in moving_columns:
            few[channel.column] = is_finite, values, frequencies[0]
    return [
        _make_problem(series.rows[is_finite][0], Code.FEW_PERIODS, column, periods=MIN_PERIODS)
        for column, (is_finite, values, frequency) in few.items()
        if not enough or _is_recurrent(series.time[is_finite], values[is_finite], frequency)
    ]


def _is_recurrent(time: np.ndarray, values: np.ndarray, frequency: float) -> bool:
    """Decide whether values are similar about a period later, if the recording is long enough."""
    longest = min(MAX_LAG / frequency, 2.0 / 3.0 * np.ptp(time))
    alike = [0.0]
    for lag in np.linspace(1.0 / MAX_LAG / frequency, longest, 33):
        early = time <= time[-1] - lag
        if np.count_nonzero(early) > 2:
            later = np.interp(time[early] + lag, time, values)
            alike.append(np.corrcoef(values[early], later)[0, 1])
    return max(alike) > MIN_RECURRENCE


def _find_copies(series: "Series", mapping: "ColumnMapping", channels: dict) -> list[dict]:
    """List problems of channels that only repeat the motion of another coordinate.

    Some combination of the two channels then varies no more than their noise (total least squares).
    """
    step, problems = float(np.median(np.diff(series.time))), []
    for (i, one), (j, other) in combinations(enumerate(mapping.channels), 2):
        both = channels[one.column], channels[other.column]
        fastest = max(f for each in both for f in (*each["dominant_frequencies_hz"], 0.0))
        noises = np.array([each["noise"] for each in both])
        motions = np.array([each["standard_deviation"] for each in both])
        is_finite = np.isfinite(series.values[:, [i, j]]).all(axis=1)
        if (
            one.measures.lstrip("d") == other.measures.lstrip("d")
            or fastest * step > (1.0 + TIME_ROUNDING) / MIN_SAMPLES_PER_PERIOD
            or np.any(motions < MIN_SIGNAL_TO_NOISE * noises)
            or not noises.all()
            or is_finite.sum() < MIN_DISTINCT_VALUES
        ):
            continue
        pair = np.cov((series.values[is_finite][:, [i, j]] / noises).T)
        least, across = np.linalg.eigh(pair)
        if least[0] < MAX_VARIANCE_RATIO:
            times = abs(across[1, 1] / across[0, 1] * noises[1] / noises[0])
            data = {"other": one.column, "times": times}
            problems.append(_make_problem(series.rows[0], Code.SHOWN_TWICE, other.column, **data))
    return problems


def _find_mix_ups(series: "Series", mapping: "ColumnMapping", channels: dict) -> list[dict]:
    """List problems of channels whose sign, or whose order, is most likely wrong."""
    problems, first = [], series.rows[0]
    by_measure = {one.measures: k for k, one in enumerate(mapping.channels)}
    for measures, k in by_measure.items():
        column = mapping.channels[k].column
        displacement = by_measure.get(measures.removeprefix("dd"))
        vertical = by_measure.get(measures.removesuffix("w") + "v")
        if measures.startswith("dd") and displacement is not None:
            pair = series.values[:, [k, displacement]]
            pair = pair[np.isfinite(pair).all(axis=1)]
            if (
                len(pair) > MIN_DISTINCT_VALUES
                and np.corrcoef(pair.T)[0, 1] > MAX_ACCELERATION_CORRELATION
            ):
                other = mapping.channels[displacement].column
                problems.append(_make_problem(first, Code.SIGN_UNLIKELY, column, other=other))
        if measures.endswith("q_w") and vertical is not None:
            other = mapping.channels[vertical].column
            size, compared = (channels[name]["standard_deviation"] for name in (column, other))
            if (times := size / max(compared, np.finfo(float).tiny)) > MAX_HORIZONTAL_RATIO:
                data = {"other": other, "times": times}
                problems.append(_make_problem(first, Code.COLUMNS_SWAPPED, column, **data))
    return problems


def estimate_noise(values: np.ndarray) -> float:
    """Estimate the standard deviation of white noise on a slow signal from fourth differences.

    values: (n,) equally spaced. Their median size is that of the noise if the motion has more than
    some ten samples a period.
    """
    differences = np.diff(values, 4)
    return float(np.median(np.abs(differences)) / (0.6745 * np.sqrt(70.0)))


def spectrum(time: np.ndarray, values: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute a power spectrum: frequencies in Hz, and the share of each in the variance.

    Short gaps are interpolated linearly; the powers of parts between long gaps are added.
    """
    signals = []
    usual = float(np.median(np.diff(time)))
    longest = max(MIN_REPORTED_GAP * usual, MIN_SPLIT_GAP * sampled_time(time))
    edges = [0, *(np.flatnonzero(np.diff(time) > longest) + 1), len(time)]
    for begin, end in pairwise(edges):
        first, last = time[begin], time[end - 1]
        grid = first + step * np.arange(round_up((last - first) / step))
        signal = np.interp(grid, time[begin:end], values[begin:end])
        if len(signal):
            signals.append((signal - signal.mean()) * np.hanning(len(signal)))
    count = max(map(len, signals))
    power = np.sum([np.abs(np.fft.rfft(signal, count)) ** 2 for signal in signals], axis=0)
    return np.fft.rfftfreq(count, step), power / max(power.sum(), np.finfo(float).tiny)


def sampled_time(time: np.ndarray, step: float | None = None) -> float:
    """Compute the total time in s that is covered by samples, without the gaps between them.

    step: usual time between samples, s; by default the median.
    """
    steps = np.diff(time)
    usual = np.median(steps) if step is None else step
    return float(steps[steps <= MIN_REPORTED_GAP * usual].sum())


def find_peaks(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the highest peaks of a power spectrum, four at most.

    share: (n,) of each frequency in the variance. Returns the shares around each frequency, (n,),
    each the sum of five; and the indices of the peaks, the highest first.
    """
    around = np.convolve(share, np.ones(5))[2 : len(share) + 2]  # also of fewer than five
    highest = around == maximum_filter1d(around, 9)
    peaks = 1 + np.flatnonzero(highest[1:-1] & (around[1:-1] > 0.01))
    return around, peaks[np.argsort(-around[peaks])][:4]


def dominant_frequencies(time: np.ndarray, values: np.ndarray, step: float) -> np.ndarray:
    """Find the frequencies, Hz, of the highest peaks of a power spectrum, the highest first."""
    frequency, share = spectrum(time, values, step)
    return frequency[find_peaks(share)[1]]


def _inspect_channel(
    time: np.ndarray, values: np.ndarray, step: float, rows: np.ndarray, unit: str, is_rate: bool
) -> tuple[dict, list[tuple[int, Code, dict]]]:
    """Describe a channel, and list its problems: first row, code and data of each.

    is_rate: whether it is an acceleration, in which random forces look like noise: it is not mostly
    noise if its spectrum has a peak.
    """
    is_finite = np.isfinite(values)
    t, y, row = time[is_finite], values[is_finite], rows[is_finite]
    sigma = estimate_noise(y)
    frequency, share = spectrum(t, y, step)
    around, peaks = find_peaks(share)
    turn = 2.0 * np.pi * step * frequency[peaks].max(initial=0.0)
    outliers = find_outliers(t, y, frequency[peaks])
    gap_ends = np.flatnonzero(np.diff(t) > MIN_REPORTED_GAP * np.median(np.diff(t))) + 1
    motion = float(np.std(y))
    thirds = np.array_split(y, 3)
    described = {
        "missing_percent": float(100 * (1 - is_finite.mean())),
        **_describe_extent(y),
        "noise": sigma,
        "outliers": int(outliers.sum()),
        "dominant_frequencies_hz": [float(frequency[k]) for k in peaks],
        "shares_of_variance": [float(around[k]) for k in peaks],
        "standard_deviation_of_thirds": [float(np.std(part)) for part in thirds],
    }
    means = np.array([part.mean() for part in thirds])
    drifts = np.ptp(means) > max(motion, 10 * sigma)
    moves, shift = _find_mean_shift(t, y) if drifts else (0, 0.0)
    problems, unit_text = [], "" if unit == "1" else unit
    coarse = (
        len(peaks) > 0
        and frequency[peaks[0]] * step > (1.0 + TIME_ROUNDING) / MIN_SAMPLES_PER_PERIOD
    )
    if outliers.any():
        problems.append((row[outliers][0], Code.OUTLIERS_SEEN, {"count": outliers.sum()}))
    at_end = np.isin(y, find_saturated_values(y))
    flat = np.convolve(at_end, np.ones(MIN_CLIPPED_SAMPLES), mode="valid") >= MIN_CLIPPED_SAMPLES
    if flat.any():
        sample = int(np.argmax(flat))
        problems.append((row[sample], Code.CLIPPED, {"at": y[sample]}))
    elif (jump := _find_jump(t, y, turn / step)) is not None:
        sample, change = jump
        problems.append((row[sample], Code.CHANNEL_JUMPS, {"change": change, "unit": unit_text}))
    if (missed := 1.0 - sampled_time(t) / sampled_time(time)) > MAX_MISSING_SHARE:
        last = row[gap_ends[0] - 1] if len(gap_ends) else row[-1]
        problems.append((last, Code.SAMPLES_MISSING, {"share": missed}))
    if (different := len(np.unique(y))) < MIN_DISTINCT_VALUES:
        problems.append((row[0], Code.RESOLVED_COARSELY, {"values": different}))
    stands_out = around.max() * np.log(2.0) > MIN_PEAK * 5.0 * np.median(share)
    if motion < MIN_SIGNAL_TO_NOISE * sigma and not (coarse or (is_rate and stands_out)):
        problems.append((row[0], Code.MOSTLY_NOISE, {}))
    if coarse:
        problems.append((row[0], Code.SAMPLED_COARSELY, {"samples": MIN_SAMPLES_PER_PERIOD}))
    if moves:
        problems.append((row[moves], Code.MEAN_MOVES, {"change": shift, "unit": unit_text}))
    elif drifts:
        problems.append((row[0], Code.MEAN_DRIFTS, {}))
    problems += [(rows[0], *unlikely) for unlikely in _find_implausible(described, unit, t, y)]
    return described, problems


def find_outliers(time: np.ndarray, values: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """Find outliers: samples that are far from the median of their neighbours.

    Returns (n,) boolean. frequencies: Hz, of the motion, the strongest first. If that one has few
    samples in a period, outliers cannot be distinguished from the motion, and none is found.
    """
    step = float(np.median(np.diff(time)))
    if len(frequencies) and frequencies[0] * step > (1.0 + TIME_ROUNDING) / MIN_SAMPLES_PER_PERIOD:
        return np.zeros(len(values), bool)
    scale = max(estimate_noise(values), 1e-9 * float(np.ptp(values)))
    turn = 2.0 * np.pi * step * frequencies.max(initial=0.0)
    bend = (np.cos(turn / 2.0) - np.cos(1.5 * turn)) / 2.0  # of its range, from such a median
    apart = OUTLIER_DEVIATION * scale + np.ptp(values) * max(bend, 0.05)
    is_outlier = np.abs(values - median_filter(values, MEDIAN_SAMPLES)) > apart
    after = np.flatnonzero(np.diff(time) > MIN_REPORTED_GAP * step) + 1
    ends = np.concatenate([[0, len(time)], after])  # where a median has no neighbours on one side
    is_outlier[np.add.outer((-2, -1, 0, 1), ends) % len(time)] = False
    return is_outlier


def _find_jump(time: np.ndarray, values: np.ndarray, omega: float) -> tuple[int, float] | None:
    """Find where a channel jumps most, and by how much, beyond its motion and noise.

    A polynomial in time and a step are fitted to each half of a period. omega: highest frequency of
    the motion, rad/s.
    """
    step = float(np.median(np.diff(time)))
    half = round_down(np.pi / 2.0 / omega / step) if omega else 0
    if half < MEDIAN_SAMPLES or len(time) < 4 * half:
        return None
    position = (np.arange(2 * half) - half + 0.5) / half
    shape = np.column_stack([legvander(position, 4), position > 0])
    jump = np.correlate(median_filter(values, MEDIAN_SAMPLES), np.linalg.pinv(shape)[-1], "valid")
    uneven = np.abs(np.diff(time) - step) > 0.5 * step  # a gap, or a clock of its own
    jump[np.convolve(uneven, np.ones(2 * half - 1), mode="valid") > 0.5] = np.nan
    size = np.abs(jump)
    if np.isnan(size).all():
        return None
    sample = int(np.nanargmax(size))
    around = JUMP_REACH * half
    neighbours = size[max(0, sample - around) : sample + around + 1]  # of a motion that decays
    usual = max(np.nanmedian(size), np.nanmedian(neighbours)) / 0.6745
    if size[sample] <= max(OUTLIER_DEVIATION * usual, MIN_JUMP * np.ptp(values)):
        return None
    return sample + half, float(jump[sample])


def _find_mean_shift(time: np.ndarray, values: np.ndarray) -> tuple[int, float]:
    """Find the sample from which a channel has another mean, and by how much; 0 if none.

    There is none if a line in time fits nearly as well.
    """
    count, whole = np.arange(1, len(values)), values - values.mean()
    explained = np.cumsum(whole)[:-1] ** 2 * len(values) / (count * (len(values) - count))
    sample, squares = int(np.argmax(explained)) + 1, whole @ whole
    line = Legendre.fit(time, whole, 1)(time) - whole
    if squares - explained[sample - 1] > 0.5 * (line @ line):
        return 0, 0.0
    return sample, float(values[sample:].mean() - values[:sample].mean())


def _describe_extent(values: np.ndarray) -> dict[str, float]:
    return {
        "mean": float(values.mean()),
        "standard_deviation": float(np.std(values)),
        "lowest": float(values.min()),
        "highest": float(values.max()),
    }


def _find_implausible(
    described: dict, unit: str, time: np.ndarray, values: np.ndarray
) -> list[tuple[Code, dict]]:
    """List properties of a channel, measuring a span in `unit`, that no span has."""
    if unit not in PLAUSIBLE_RANGES:
        return []
    (least, most), size = PLAUSIBLE_RANGES[unit], described["highest"] - described["lowest"]
    unlikely = []
    if not least <= size <= most:
        data = {"size": size, "least": least, "most": most, "unit": unit}
        unlikely.append((Code.UNIT_UNLIKELY, data))
    slowest, fastest = PLAUSIBLE_FREQUENCIES
    dominant = described["dominant_frequencies_hz"]
    likely = any(slowest <= frequency <= fastest for frequency in dominant)
    if dominant and not likely and _is_recurrent(time, values, dominant[0]):
        data = {"frequency_hz": dominant[0], "least": slowest, "most": fastest}
        unlikely.append((Code.TIME_UNIT_UNLIKELY, data))
    return unlikely


def _describe_input(series: "Series", column: "InputColumn") -> dict:
    one = series.inputs[column.name]
    is_finite = np.isfinite(one.values)
    return {
        "name": column.name,
        "unit": series.units[column.name],
        **_describe_extent(one.values[is_finite]),
        "step_s": float(np.median(np.diff(one.time[is_finite]))),
        "between": one.between,
        "error": column.error,
    }
