"""What a verdict claims, on regressions where the truth is drawn."""

import numpy as np

from galloping.identification.likelihood.problem import posed
from galloping.identification.likelihood.result import judged
from galloping.identification.likelihood.selection import select
from galloping.identification.model import IdentifiedModel

TERMS = tuple((k,) for k in range(12))
PROBLEM = posed(("x",), TERMS)
PENALTY = 2.0 * np.log(2000)


def verdict_on(true: np.ndarray, columns: np.ndarray, rng: np.random.Generator) -> IdentifiedModel:
    observed = columns @ true + rng.normal(size=len(columns))
    information, right = columns.T @ columns, columns.T @ observed
    support = select(information, right, [np.ones(len(true), bool)], PENALTY)
    return judged(
        PROBLEM, information, right, support, PENALTY,
        initial_states=np.zeros((1, 1)), sigma=np.ones((1, 1)), chi2=1.0,
    )  # fmt: skip


def imitating(rng: np.random.Generator) -> np.ndarray:
    columns = rng.normal(size=(2000, 12))
    for k in range(1, 12):
        columns[:, k] = columns[:, k - 1] + rng.choice([0.1, 0.3, 1.0]) * columns[:, k]
    return columns


def test_what_ok_claims_holds_and_the_unconditional_interval_covers() -> None:
    # strong terms beside weak ones of any size, in columns that imitate each other
    rng = np.random.default_rng(2024)
    sure = wrong = held = terms = 0
    for _ in range(200):
        columns = imitating(rng)
        size = 10.0 ** rng.uniform(-2.5, 0.5, 12)
        true = np.where(rng.random(12) < 0.4, size * rng.choice([-1.0, 1.0], 12), 0.0)
        result = verdict_on(true, columns, rng)
        distance = np.abs(result.model.coefficients[0] - true)
        held += np.sum((distance < 1.96 * result.unconditional_errors[0])[true != 0.0])
        terms += np.sum(true != 0.0)
        if result.status == "ok":
            sure += 1
            present = result.support[0]
            limits = result.detection_limits[0][~present]
            wrong += bool(
                np.any(true[present] == 0.0)
                or np.any(np.abs(true[~present]) > limits)
                or np.any(distance[present] > 4.0 * result.unconditional_errors[0][present])
            )
    assert sure > 40
    assert wrong <= 0.02 * 200
    assert 0.93 < held / terms < 0.98


def test_a_term_that_another_can_replace_is_not_identifiable() -> None:
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(2000, 12))
    columns[:, 1] = columns[:, 0] + 0.005 * columns[:, 1]
    true = np.zeros(12)
    true[0] = 1.0
    result = verdict_on(true, columns, rng)
    assert result.status == "not identifiable"
    assert "the data cannot tell" in result.reason


def test_an_absent_term_has_a_limit_and_no_bearing_on_the_verdict() -> None:
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(2000, 12))
    columns[:, 7] *= 1e-4  # the data say little of this term
    result = verdict_on(np.eye(12)[0], columns, rng)
    assert result.status == "ok", result.reason
    limits = result.detection_limits[0]
    assert np.isnan(limits[0])
    assert limits[7] > 1e3 * np.nanmax(np.delete(limits, 7))


def test_nothing_found_is_not_identifiable() -> None:
    rng = np.random.default_rng(5)
    result = verdict_on(np.zeros(12), rng.normal(size=(2000, 12)), rng)
    assert (result.status, result.reason) == (
        "not identifiable",
        "no term stands out of the noise",
    )
