"""Identification: exact without noise, equal to pysindy's own, and failures kept as rows."""

import sys
from dataclasses import replace
from pkgutil import resolve_name
from unittest.mock import Mock

import numpy as np
import pysindy as ps
import pytest
from lines import moved, recorded, simulate

from galloping.configuration.load import load, plain
from galloping.identification.cell import identify
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import IdentificationError
from galloping.identification.oscillations import Resonance
from galloping.identification.registry import BY_NAME, METHODS
from galloping.identification.sparse.evidence import differentiate, reduce, reduce_by_splines
from galloping.identification.sparse.stlsq import bagged_medians
from galloping.identification.sparse.supports import best_threshold, ebic
from galloping.model.polynomial import PolynomialModel, design_matrix, polynomial_library
from galloping.recording.samples import Recording
from galloping.study.files import read_identified, write_identified

TERMS = polynomial_library(4, 3)
SETTINGS = plain(load({}))["identification"]
COMBINATIONS = [  # accelerations alone: test_rate_channels; weak_gls, made for noise: with noise
    (m.name, protocol, None)
    for m in METHODS
    for protocol in m.protocols
    if m.name != "weak_gls" and protocol != "acceleration"
] + [
    (m.name, "derivative", points)
    for m in METHODS
    for points in (100, 115, 389, 1000)  # shorter, too, than their factor
    if not m.needs_uniform and "derivative" in m.protocols
]
FILTERED = [(method, "state") for method in ("stlsq", "lasso", "frols", "ensemble")]
NAME = ("a_case", "state", "a_cell")
OSCILLATOR = PolynomialModel(
    ("x", "dx"), polynomial_library(2, 1), np.array([[0.0, 0.0, 1.0], [0.3, -2.0, 0.0]])
)


def recordings(simulated, protocol, points=None, **drawn):
    name = ("a_case", protocol, "a_cell")
    return recorded(moved(*simulated), protocol=protocol, samples=points, name=name, **drawn)


def run(method, replicates, **options):
    """What a method makes of replicates of one recording each."""
    settings = BY_NAME[method].settings(SETTINGS, 3)
    settings["options"] |= options
    items = [[recording] for recording in replicates]
    return identify({method: settings}, items, TERMS, NAME)[method]


@pytest.mark.parametrize(("method", "protocol", "points"), COMBINATIONS)
def test_exact_without_noise(resonant, method, protocol, points):
    true = resonant[0].on_library(TERMS)
    (found,) = run(method, recordings(resonant, protocol, level=0, points=points))
    assert found.status != "refused"
    assert np.array_equal(found.model.coefficients != 0, true.support)
    # rounding may decide which filter smooths exact states: one of them has an error of 5e-6
    rel = 1e-5 if (method, protocol) in FILTERED else 1e-6
    assert found.model.coefficients == pytest.approx(true.coefficients, rel=rel)


@pytest.mark.filterwarnings("ignore:Sparsity parameter is too big")
@pytest.mark.parametrize("threshold", [None, 1e-4, 1e-3, 1e-2, 0.1, 0.5])  # None: as it is chosen
@pytest.mark.parametrize("method", ["stlsq", "paper"])
def test_thresholds_give_pysindy_s_model_on_all_samples(resonant, method, threshold):
    (recording,) = recordings(resonant, "derivative", level=0.1)
    (ours,) = run(method, [recording], threshold=threshold)
    theta, targets = design_matrix(recording.values, TERMS), recording.rates
    lengths, scale = np.ones(len(TERMS)), np.ones(4)
    if method == "stlsq":
        lengths, scale = np.linalg.norm(theta, axis=0), np.linalg.norm(targets, axis=0)
    for row in range(4):
        optimizer = ps.STLSQ(threshold=ours.thresholds[row], alpha=0, max_iter=100)
        optimizer.fit(theta / lengths, targets[:, [row]] / scale[row])
        expected = optimizer.coef_[0] * scale[row] / lengths
        assert ours.model.coefficients[row] == pytest.approx(expected, rel=1e-8)


def test_joint_recordings_are_one_regression(resonant):
    first, second = recordings(resonant, "derivative", replicates=2)
    joint = reduce_by_splines([first, second], TERMS)
    theta = np.vstack([design_matrix(r.values, TERMS) for r in (first, second)])
    dx = np.vstack([r.rates for r in (first, second)])
    assert joint.library.T @ joint.targets == pytest.approx(theta.T @ dx, rel=1e-9)
    assert joint.observations.tolist() == [60002] * 4


def test_ebic_charges_for_terms():
    found = ebic(np.array([1.0, 1.0, 2.0]), np.array([3, 4, 3]), 1000, 35)
    assert np.diff(found[[0, 1]]) == pytest.approx(np.log(1000) + 2 * np.log(35))
    assert np.diff(found[[0, 2]]) == pytest.approx(1000 * np.log(2))


def test_best_threshold_is_the_middle_of_its_range():
    thresholds = np.array([0.001, 0.01, 0.1, 1.0])
    supports = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 0], [1, 0, 0]], dtype=bool)
    assert best_threshold(thresholds, supports, 1) == pytest.approx(10**-1.5)


@pytest.mark.parametrize("method", ["stlsq", "paper", "lasso", "ensemble"])
def test_choice_does_not_depend_on_the_truth_or_the_scale(resonant, method):
    # in other units of time, the same structure and scaled coefficients
    (recording,) = recordings(resonant, "derivative", level=0.01)
    (found,) = run(method, [recording])
    scaled = replace(recording, rates=4 * recording.rates)
    (again,) = run(method, [scaled])
    assert again.model.coefficients == pytest.approx(4 * found.model.coefficients, rel=1e-9)


@pytest.mark.parametrize("method", ["stlsq", "paper", "lasso", "ensemble"])
def test_a_configured_threshold_is_used(resonant, method):
    items = recordings(resonant, "derivative")
    loose, tight, none = (run(method, items, threshold=size)[0] for size in (1e-3, 0.1, 1e3))
    assert np.all(loose.thresholds == 1e-3) and np.all(tight.thresholds == 0.1)
    assert np.count_nonzero(tight.model.coefficients) < np.count_nonzero(loose.model.coefficients)
    assert not none.model.coefficients.any()


@pytest.mark.parametrize("sigma", [np.zeros(2), np.array([0.05, 0.02])], ids=["exact", "noisy"])
@pytest.mark.parametrize("sampling", ["regular", "irregular"])
def test_smoothing_takes_out_noise_alone(sampling, sigma):
    rng = np.random.default_rng(1)
    time = np.arange(6001) / 100
    if sampling == "irregular":
        time = np.sort(rng.choice(time, 3000, replace=False))
    omega = 2 * np.pi * np.array([0.2, 0.43])
    values, slopes = np.sin(np.outer(time, omega)), omega * np.cos(np.outer(time, omega))
    noisy = values + sigma * rng.standard_normal(values.shape)
    smoothed, derivative, effective = differentiate(time, noisy)
    if not sigma.any():
        assert smoothed == pytest.approx(values, abs=1e-9)
        assert derivative == pytest.approx(slopes, abs=1e-6)
        return
    inner = slice(len(time) // 20, -len(time) // 20)
    residual = np.std((smoothed - values)[inner], axis=0)
    assert np.all(residual < 0.02)
    assert np.all(np.std((derivative - slopes)[inner], axis=0) < 0.1)
    # as many values are left as the noise that stays says: sigma^2 p / n
    assert residual == pytest.approx(sigma * np.sqrt(effective / len(time)), rel=0.4)


def test_too_few_samples_to_differentiate():
    with pytest.raises(IdentificationError) as error:
        differentiate(np.arange(12.0), np.ones((12, 1)))
    assert error.value.findings == (Finding.of(Code.RECORDING_SHORT, samples=12),)


@pytest.mark.parametrize(
    ("protocol", "name", "lacking"),
    [("derivative", "values", "state"), ("state", "values", "state"),
     ("derivative", "rates", "derivative")],
)  # fmt: skip
def test_missing_values_are_refused(resonant, protocol, name, lacking):
    (recording,) = recordings(resonant, protocol)
    samples = getattr(recording, name).copy()
    samples[7, 1] = np.nan
    with pytest.raises(IdentificationError) as error:
        reduce([replace(recording, **{name: samples})], TERMS)
    assert error.value.findings == (Finding.of(Code.INCOMPLETE_SAMPLES, lacking),)


def test_weak_form_refuses_what_it_cannot_use(resonant):
    (good,) = recordings(resonant, "state")
    (subset,) = recordings(resonant, "state", points=1000)
    values = good.values.copy()
    values[3, 0] = np.nan
    results = run("weak", [subset, replace(good, values=values), good])
    assert [(found.status, found.codes) for found in results] == [
        ("refused", "irregular_samples"),
        ("refused", "incomplete_samples"),
        ("unjudged", ""),
    ]


@pytest.mark.parametrize("method", ["stlsq", "paper", "lasso", "ensemble"])
def test_a_motionless_recording_is_a_row_with_a_reason(resonant, method):
    (recording,) = recordings(resonant, "derivative")
    values, rates = recording.values.copy(), recording.rates.copy()
    values[:, 1] = values[:, 3] = rates[:, 1] = rates[:, 3] = 0
    still = replace(recording, values=values, rates=rates)
    failed, good = run(method, [still, recording])
    assert failed.codes == "state_zero"
    assert failed.model.coefficients.shape == (4, len(TERMS))
    assert np.isnan(failed.model.coefficients).all()
    assert good.status == "unjudged"


@pytest.fixture(scope="module")
def replicates():
    """Three replicates of a short record."""
    whole = recordings(simulate("internal_resonance"), "state", replicates=3)
    return [recording[:6000] for recording in whole]


@pytest.mark.parametrize("method", BY_NAME)
def test_a_replicate_depends_neither_on_others_nor_on_the_global_random_state(replicates, method):
    np.random.seed(12)
    before = np.random.get_state()
    assert run(method, replicates[:1]) == run(method, replicates[:2])[:1]
    after = np.random.get_state()
    assert np.array_equal(before[1], after[1]) and before[2:] == after[2:]


def test_a_method_finds_the_same_beside_others(replicates):
    both = {name: BY_NAME[name].settings(SETTINGS, 3) for name in ("lasso", "stlsq")}
    found = identify(both, [[each] for each in replicates[:1]], TERMS, NAME)
    assert found == {name: run(name, replicates[:1]) for name in both}


def test_bootstraps_are_drawn_by_position(replicates):
    # every replicate has its own draws: the same recording twice gives two models
    item = replicates[0]
    several = run("ensemble", [item] * 3, models=2)
    assert len(set(several)) > 1
    assert several[:1] == run("ensemble", [item], models=2)


def test_bagging_is_that_of_pysindy(resonant):
    (recording,) = recordings(resonant, "derivative")
    problem = reduce_by_splines([recording], TERMS)
    library, targets = problem.library, problem.targets / 1e-3
    optimizer = ps.EnsembleOptimizer(
        ps.STLSQ(threshold=1, alpha=0, unbias=False), bagging=True, n_models=5
    )
    np.random.seed(np.random.default_rng(2).integers(2**32))
    theirs = optimizer.fit(library, targets).coef_
    ours = bagged_medians(library, targets, 5, np.random.default_rng(2))
    assert np.array_equal(ours != 0, theirs != 0) and np.count_nonzero(ours) > 10
    assert ours == pytest.approx(theirs, rel=1e-6)


def test_a_method_is_told_its_own_settings_alone():
    assert all(callable(resolve_name(name)) for method in METHODS for name in method.modules)
    fixed = SETTINGS | {"stlsq": {**SETTINGS["stlsq"], "threshold": 0.1}}
    changed = [m.name for m in METHODS if m.settings(fixed, 3) != m.settings(SETTINGS, 3)]
    assert changed == ["stlsq"]
    assert BY_NAME["stlsq"].settings(fixed, 3)["options"]["threshold"] == 0.1
    drawing = [m.name for m in METHODS if m.settings(SETTINGS, 4) != m.settings(SETTINGS, 3)]
    assert drawing == ["ensemble"]


def test_results_come_back_from_files(tmp_path):
    model = OSCILLATOR
    errors = np.array([[np.nan] * 3, [0.01, np.nan, 2e-4]])
    kept = IdentifiedModel(
        model, (Finding.of(Code.TERM_PLAUSIBLE, terms="q", chi2=-9.0),), True, errors,
        detection_limits=np.full((2, 3), np.inf),
        covariance=np.eye(2), chi2=1.5, known=(0,),
    )  # fmt: skip
    sure = replace(
        kept, sigma=np.ones((1, 2)), initial_states=np.zeros((1, 2)), rivals=np.ones((4, 2, 3)),
        rival_share=0.1, forces=np.diag([0.0, 0.2]),
        diagnostics={"told": 0.25, "path": "few terms"},
        resonances=(Resonance(2.0, 0.1, (0.1, 0.01), (0.0, 1.0), (0.0, 0.1, 0.2)),),
    )  # fmt: skip
    failed = IdentifiedModel.refused(model.states, model.terms, [Finding.of(Code.STATE_ZERO)])
    unjudged = IdentifiedModel(model, thresholds=np.array([0.1, 0.2]))
    for name in ("a.json", "b.json"):
        write_identified(tmp_path / name, {"a": [sure, failed], "b": [unjudged]})
    assert read_identified(tmp_path / "a.json") == {"a": [sure, failed], "b": [unjudged]}
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    for result in (sure, failed, unjudged):
        result.save(tmp_path / "one.json")
        assert IdentifiedModel.load(tmp_path / "one.json") == result


def test_the_status_of_a_model_that_was_assessed_follows_from_its_findings():
    bare, doubt = IdentifiedModel(OSCILLATOR), Finding.of(Code.SINGLE_START)
    assert (bare.status, bare.with_findings(doubt).status) == ("unjudged", "unjudged")
    found = replace(bare, is_judged=True)
    assert (found.status, found.with_findings(doubt).status) == ("ok", "not identifiable")


def test_a_model_prints_and_moves(resonant):
    line, trajectory = resonant
    model = OSCILLATOR
    errors = np.array([[np.nan] * 3, [0.01, 2e-4, np.nan]])
    result = IdentifiedModel(model, is_judged=True, standard_errors=errors, known=(0,))
    assert str(result).splitlines() == [
        "d(x)/dt = 1 dx",
        "d(dx)/dt = (0.300 ± 0.010) + (-2.00000 ± 0.00020) x",
        "ok",
    ]
    assert result.support.tolist() == [[False] * 3, [True, True, False]]
    moved = IdentifiedModel(line).simulate(trajectory.states[0], trajectory.time)
    assert np.array_equal(moved.states[:100], trajectory.states[:100])


def test_only_recordings_that_give_no_model_are_refused(monkeypatch):
    """What is a mistake in the code ends the job."""
    settings = {"mine": {"evidence": None, "function": "mine:fit", "options": {}, "seed": None}}
    still = [Recording(np.arange(3.0), ("x",), np.zeros((3, 1)))]

    def raising(error):
        monkeypatch.setitem(sys.modules, "mine", Mock(fit=Mock(side_effect=error)))
        return identify(settings, [still], polynomial_library(1, 1), NAME)["mine"][0]

    assert raising(IdentificationError(Code.NO_MOTION)).codes == "no_motion"
    assert raising(FloatingPointError("overflow")).findings[0].data == {"error": "overflow"}
    with pytest.raises(ValueError, match="shapes differ"):
        raising(ValueError("shapes differ"))
