"""Findings on recordings, as values: a code with its data, and no sentences.

`findings.csv` has a row for each code: its severity, the keys of its data, and three templates, of
the sentence in a verdict, of its meaning to an engineer and of advice. `sentences` fills them in.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cache
from importlib.resources import files
from math import isfinite

from galloping.arrays import Immutable


class Severity(StrEnum):
    """Severity of a finding: what it means for the model, from a note to a fault."""

    NOTE = "note"  # the model is valid
    WARNING = "warning"  # other models may be right as well
    INEXACT = "inexact"  # no model of the library is right
    FAULT = "fault"  # there is no model


class Code(StrEnum):
    """Codes of all that an identification can notice in recordings, the most important first.

    Times in the data of a finding are in s on the clock of a recording.
    """

    RELEASED = "released"
    CAME_TO_REST = "came_to_rest"
    KNOCKED = "knocked"
    FORCE_STEPPED = "force_stepped"
    FORCED_STEADILY = "forced_steadily"
    UNIT_UNLIKELY = "unit_unlikely"
    TIME_UNIT_UNLIKELY = "time_unit_unlikely"
    SIGN_UNLIKELY = "sign_unlikely"
    COLUMNS_SWAPPED = "columns_swapped"
    FEW_PERIODS = "few_periods"
    SAMPLED_COARSELY = "sampled_coarsely"
    SAMPLES_MISSING = "samples_missing"
    OUTLIERS_SEEN = "outliers_seen"
    CLIPPED = "clipped"
    RESOLVED_COARSELY = "resolved_coarsely"
    NOT_ACCELERATED = "not_accelerated"
    SHOWN_TWICE = "shown_twice"
    PRIOR_CONTRADICTED = "prior_contradicted"
    BOUNDS_CONTRADICTED = "bounds_contradicted"
    NO_FORCE_NEEDED = "no_force_needed"
    RANDOM_FORCES = "random_forces"
    FASTER_MODES_LEFT_OUT = "faster_modes_left_out"
    MODE_BESIDE = "mode_beside"
    FASTER_LEFT_OUT = "faster_left_out"
    INNOVATION_JUMPS = "innovation_jumps"
    TERM_MISSING = "term_missing"
    DRAG_IMITATED = "drag_imitated"
    FORCE_MISSING = "force_missing"
    KEPT_UP = "kept_up"
    OUTLIVED = "outlived"
    PARTS_DIFFER = "parts_differ"
    FREQUENCY_CHANGES = "frequency_changes"
    DAMPING_CHANGES = "damping_changes"
    RECORDINGS_DIFFER = "recordings_differ"
    NO_COMMON_MODEL = "no_common_model"
    FORCES = "forces"
    COEFFICIENTS_FLUCTUATE = "coefficients_fluctuate"
    FORCES_BESIDE_INPUTS = "forces_beside_inputs"
    MORE_MODES = "more_modes"
    INPUT_HELD = "input_held"
    INPUT_DELAYED_BY = "input_delayed_by"
    INPUT_DELAYED = "input_delayed"
    INPUT_UNDERSAMPLED = "input_undersampled"
    CHANNEL_DELAYED = "channel_delayed"
    COORDINATE_DELAYED = "coordinate_delayed"
    RATE_DISAGREES = "rate_disagrees"
    RATES_DISAGREE = "rates_disagree"
    RATE_SCALED = "rate_scaled"
    SCALE_UNDETERMINED = "scale_undetermined"
    CHANNEL_JUMPS = "channel_jumps"
    MEAN_MOVES = "mean_moves"
    MEAN_DRIFTS = "mean_drifts"
    DRIFTS = "drifts"
    RESIDUAL_DRIFTS = "residual_drifts"
    NOISE_GROWS = "noise_grows"
    RESIDUAL_LINE = "residual_line"
    FURTHER_MODE = "further_mode"
    TIMES_JITTER = "times_jitter"
    NOISE_EXCEEDS_KNOWN = "noise_exceeds_known"
    OUTLIERS = "outliers"
    GAPS = "gaps"
    GAPS_EVERYWHERE = "gaps_everywhere"
    SAMPLES_INCOMPLETE = "samples_incomplete"
    MOSTLY_NOISE = "mostly_noise"
    NO_MOTION = "no_motion"
    NO_TERM = "no_term"
    SECOND_STATE_MISSING = "second_state_missing"
    NOT_MEASURED = "not_measured"
    NOT_SENSED = "not_sensed"
    SINGLE_START = "single_start"
    MOTION_REPEATS = "motion_repeats"
    PRIOR_DECIDES = "prior_decides"
    TERM_MAY_HIDE = "term_may_hide"
    INPUT_RANGE_SHORT = "input_range_short"
    ALIASED_TERMS = "aliased_terms"
    RIVAL_TERMS = "rival_terms"
    UNSETTLED = "unsettled"
    TERM_PLAUSIBLE = "term_plausible"
    TERM_MAY_BE_MISSING = "term_may_be_missing"
    MIXTURE_MAY_HIDE = "mixture_may_hide"
    RESIDUAL_MODE = "residual_mode"
    FORCES_NOT_WHITE = "forces_not_white"
    FOLLOWED_IN_PIECES = "followed_in_pieces"
    ITERATION_DIVERGES = "iteration_diverges"
    NOT_FOLLOWED = "not_followed"
    NOT_PREFERRED = "not_preferred"
    PREDICTS_NOTHING = "predicts_nothing"
    NO_OSCILLATION = "no_oscillation"
    MODES_ALIKE = "modes_alike"
    STIFFNESS_UNDETERMINED = "stiffness_undetermined"
    MOTION_TOO_QUICK = "motion_too_quick"
    MODES_UNDETERMINED = "modes_undetermined"
    OFFSET_UNDETERMINED = "offset_undetermined"
    COMPUTATION_FAILED = "computation_failed"
    LIMIT_OF_WORK = "limit_of_work"
    FORCES_UNDETERMINED = "forces_undetermined"
    FORCES_BESIDE_FUNCTIONS = "forces_beside_functions"
    NOTHING_LEFT = "nothing_left"
    INPUTS_MISSING = "inputs_missing"
    TERM_INFINITE = "term_infinite"
    TERM_OVERFLOWS = "term_overflows"
    IRREGULAR_SAMPLES = "irregular_samples"
    INCOMPLETE_SAMPLES = "incomplete_samples"
    RECORDING_SHORT = "recording_short"
    STATE_ZERO = "state_zero"
    TERM_UNDETERMINED = "term_undetermined"
    TERMS_NOT_IN_LIBRARY = "terms_not_in_library"
    NO_MODEL = "no_model"
    FORECASTS_MISS = "forecasts_miss"
    FREE_RUN_MISSES = "free_run_misses"
    NOT_EXPONENTIAL = "not_exponential"
    WEAK_MISFIT = "weak_misfit"
    DERIVATIVES_CORRELATED = "derivatives_correlated"
    NOISE_CORRELATED = "noise_correlated"
    RESIDUAL_POWER = "residual_power"


@dataclass(frozen=True)
class Kind:
    """Properties of all findings with the same code, a row of `findings.csv`."""

    severity: Severity
    keys: frozenset[str]
    sentence: str
    meaning: str
    advice: str


@cache
def finding_kinds() -> dict[Code, Kind]:
    """Read the severity, data keys and texts of each finding code from `findings.csv`."""
    text = files(__package__).joinpath("findings.csv").read_text(encoding="utf-8")
    return {
        Code(row["code"]): Kind(
            Severity(row["severity"]), frozenset(row["data"].split()), row["sentence"],
            row["meaning"], row["advice"],
        )
        for row in csv.DictReader(text.splitlines())
    }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Finding(Immutable):
    """Something noticed in a recording, as a code with data, and its severity for the model.

    Parameters
    ----------
    code : Code
    severity : Severity
    subject : str
        The state or channel that shows it, '' if all do.
    data : mapping of str to float or str
        By the names that `findings.csv` lists for the code; text is a name, such as that of a term.
    recording : int
        Index among the recordings as they were given.

    Raises
    ------
    ValueError
        If the data are not those of the code.
    """

    code: Code
    severity: Severity
    subject: str = ""
    data: Mapping[str, float | str] = field(default_factory=dict)
    recording: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "code", Code(self.code))
        object.__setattr__(self, "severity", Severity(self.severity))
        keys = finding_kinds()[self.code].keys
        if keys != set(self.data):
            raise ValueError(f"data of {self.code}: {sorted(self.data)}; must be {sorted(keys)}")
        data = {name: _number_or_name(value) for name, value in self.data.items()}
        object.__setattr__(self, "data", data)
        super().__post_init__()

    @classmethod
    def of(cls, code: Code, subject: str = "", **data: float | str) -> Finding:
        """Make a finding with the default severity of its code."""
        return cls(code, finding_kinds()[code].severity, subject, data)

    def as_dict(self) -> dict[str, object]:
        """Convert the finding to a dict of plain values; NaN and infinite numbers become text."""
        data = {
            name: value if isinstance(value, str) or isfinite(value) else str(value)
            for name, value in self.data.items()
        }
        return {
            "code": self.code.value, "severity": self.severity.value, "subject": self.subject,
            "data": data, "recording": self.recording,
        }  # fmt: skip


def _number_or_name(value: float | str) -> float | str:
    if isinstance(value, str) and value not in ("inf", "-inf", "nan"):
        return value
    return float(value)


def as_warnings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Lower fault findings to warnings, since another search did find a model."""
    return tuple(
        replace(each, severity=Severity.WARNING) if each.severity == Severity.FAULT else each
        for each in findings
    )


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
