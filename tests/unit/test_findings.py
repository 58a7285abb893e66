"""Findings: their table, the status that follows from them, and that nobody reads sentences."""

import json
import re
from pathlib import Path
from string import Formatter

import numpy as np
import pytest

import galloping
from galloping.identification.findings import (
    Code,
    Finding,
    Severity,
    as_warnings,
    finding_kinds,
    status_of,
)
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.sentences import explain, reason_of, sentence_of
from galloping.summary.advice import HELPS

SOURCE = Path(galloping.__file__).parent
IN_SHARE = {"share_percent", "share_in_words"}


def fields(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def test_the_table_has_a_row_for_each_code_in_its_order():
    assert list(finding_kinds()) == list(Code)


@pytest.mark.parametrize("code", Code)
def test_templates_name_only_the_data_of_their_code(code):
    kind = finding_kinds()[code]
    data = kind.keys | {"subject"} | (IN_SHARE if "share" in kind.keys else set())
    assert fields(kind.sentence) <= data
    assert fields(kind.meaning) <= data | {"name", "unit"}
    assert fields(kind.advice) <= data | set(HELPS)
    assert kind.sentence or kind.meaning


def test_data_must_be_those_of_the_code():
    with pytest.raises(ValueError, match="data of drifts: "):
        Finding.of(Code.DRIFTS, "q", share=0.1)


def test_the_status_follows_from_findings():
    doubt, forced = Finding.of(Code.UNSETTLED), Finding.of(Code.RANDOM_FORCES)
    missed = Finding.of(Code.FREE_RUN_MISSES, "q", share=0.1)
    assert status_of([]) == status_of([forced]) == "ok"
    assert status_of([doubt]) == "not identifiable"
    assert status_of([forced, doubt]) == status_of([doubt, missed]) == "approximate"
    assert status_of([doubt, missed, Finding.of(Code.NO_MODEL)]) == "refused"
    failed = Finding.of(Code.ITERATION_DIVERGES)  # of another search
    assert status_of(as_warnings([failed, missed])) == "approximate"


def test_a_model_without_a_cause_is_refused_for_none():
    found = IdentifiedModel.refused(("x",), ((1,),), [Finding.of(Code.LIMIT_OF_WORK)])
    assert (found.status, found.codes) == ("refused", "limit_of_work no_model")


def test_infinite_numbers_and_severities_come_back_from_json():
    one = Finding(Code.TERM_MAY_HIDE, Severity.INEXACT, "x", {"term": "y", "share": np.inf}, 2)
    plain = json.loads(json.dumps(one.as_dict(), allow_nan=False))
    assert Finding(**plain) == one


def test_what_weighs_more_is_said_first_and_once():
    least, more = Finding.of(Code.RESIDUAL_POWER, band=2.0, chi2=3.0), Finding.of(Code.NOISE_GROWS)
    assert reason_of([least, more, more]).startswith(sentence_of(more))
    assert reason_of([least, more, more]).count(sentence_of(more)) == 1
    assert len(explain([least], True, words=HELPS)) == 1
    assert explain([least, more], True, words=HELPS) == explain([more], True)


def test_a_percent_sign_is_apart_from_its_number_as_in_all_texts():
    missed = Finding.of(Code.FORECASTS_MISS, "q_v", share=0.105, span_s=22.0)
    assert " 10.5 % of the motion" in sentence_of(missed)


def test_advice_of_two_findings_is_the_same():
    repeats, rivals = finding_kinds()[Code.MOTION_REPEATS], finding_kinds()[Code.RIVAL_TERMS]
    assert repeats.advice.startswith(rivals.advice)


def test_no_steady_motion_is_advised_and_an_unexplained_frequency_is_named():
    failed, line = Finding.of(Code.ITERATION_DIVERGES), (Code.RESIDUAL_LINE, "q_v")
    ((_, advice),) = explain([failed], True, words=HELPS)
    assert "steady motion" not in advice  # a limit cycle has the motion of many equations
    tone = Finding.of(*line, frequency_hz=1.07, band=1.2, chi2=1.1)
    ((meaning, _),) = explain([*as_warnings([failed]), tone], True, words=HELPS)
    assert "at 1.07 Hz" in meaning


# Lines that compare, search, split, edit or branch on a rendered sentence.
READS_PROSE = re.compile(
    r"\b(if|or|and|in|not|==|!=) [\w.]+(\.(reason|verdict)\b|\[.(reason|what).\])"
    r"|(\.(reason|verdict)|\[.(reason|what).\])(\.\w+\(|\[| ==| !=| (in|or|and)\b)"
    r"|re\.\w+\(.*\.(reason|verdict)\b"
)
READING = (
    "if REPEATS in found.reason: pass", "found.reason.split('; ')", "x = found.reason or other",
    "re.search('a', found.verdict)", "found.reason == ''", "'a' in problem['what']",
)  # fmt: skip


def test_nothing_in_the_library_reads_what_is_rendered_from_findings():
    assert all(map(READS_PROSE.search, READING))
    rooms = (
        "identification", "inspection", "behaviour", "summary", "trials", "evaluation", "study",
        "readers",
    )  # fmt: skip
    paths = [path for room in rooms for path in sorted(SOURCE.glob(f"{room}/**/*.py"))]
    lines = [line for path in paths for line in path.read_text(encoding="utf-8").splitlines()]
    assert len(paths) > 100 and [line for line in lines if READS_PROSE.search(line)] == []
