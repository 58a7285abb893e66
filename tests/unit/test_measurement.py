"""Recordings: noise, subsets, seeds by name, and files."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from lines import CASES, moved, simulate

from galloping.recording.measurement import recordings_of
from galloping.results import Motion
from galloping.streams import make_generator
from galloping.study.files import read_recordings, write_recordings

NAME = ("internal_resonance", "state", "noise_0.05")
DRAWN = {"protocol": "state", "level": 0.05, "relative": True, "samples": 30001, "replicates": 2,
         "seed": 1, "name": NAME}  # fmt: skip


def record(simulated, motions=None, **settings):
    """The first recording of each replicate."""
    measured = recordings_of(motions or [moved(*simulated)], recordings=1, **(DRAWN | settings))
    return [each[0] for each in measured]


@pytest.mark.parametrize("relative", [True, False])
@pytest.mark.parametrize("protocol", ["derivative", "state", "displacement", "acceleration"])
@pytest.mark.parametrize("name", CASES)
def test_noise_of_each_protocol(name, protocol, relative):
    """On what it measures, in standard deviations of the motion or in SI units; of derivatives
    always in these. What it does not measure is missing."""
    line, trajectory = simulate(name)
    exact, rates = trajectory.states, line(trajectory.states)
    (recording,) = record(simulate(name), protocol=protocol, relative=relative, replicates=1)
    values = recording.values
    assert recording.exact == (protocol == "derivative")
    if recording.exact:
        assert np.array_equal(values, exact)
        check_noise(recording.rates - rates, np.full(4, 0.05))
        return
    measured = {"state": slice(None), "displacement": slice(2), "acceleration": slice(2, None)}
    assert (recording.rates is None) == (protocol != "acceleration")
    if protocol == "acceleration":
        assert np.isnan(values).all()
        values, exact = recording.rates, rates
    sigma = 0.05 * (exact.std(axis=0) if relative else np.ones(4))
    kept = measured[protocol]
    assert np.isnan(np.delete(values, kept, axis=1)).all()
    check_noise((values - exact)[:, kept], sigma[kept])


@pytest.mark.parametrize(
    ("protocol", "measured"), [("displacement", [0, 3]), ("acceleration", [1, 2])]
)
def test_what_a_protocol_measures_follows_from_the_names_of_states(protocol, measured):
    states = np.random.default_rng(0).normal(size=(50, 5))
    motion = Motion(("a", "da", "db", "b", "z"), np.arange(50.0), states, states)
    (recording,) = record(None, [motion], protocol=protocol, samples=50, replicates=1)
    channels = recording.values if protocol == "displacement" else recording.rates
    assert np.flatnonzero(np.isfinite(channels).all(axis=0)).tolist() == measured
    with pytest.raises(ValueError, match=f"protocol: '{protocol}'; must be derivative or state"):
        record(None, [replace(motion, names=tuple("abcde"))], protocol=protocol, samples=50)


def check_noise(noise, sigma):
    """White, Gaussian, independent between channels; bounds at five standard errors."""
    n, unit = len(noise), noise / sigma
    assert np.abs(unit.mean(axis=0)).max() < 5 / np.sqrt(n)
    assert np.abs(unit.std(axis=0) - 1).max() < 5 / np.sqrt(2 * n)
    assert np.abs((unit**4).mean(axis=0) - 3).max() < 5 * np.sqrt(96 / n)
    assert np.abs((unit[1:] * unit[:-1]).mean(axis=0)).max() < 5 / np.sqrt(n)
    assert all(abs(np.mean(a * b)) < 5 / np.sqrt(n) for a, b in combinations(unit.T, 2))


def test_subsets_are_drawn_without_replacement_and_sorted(resonant):
    _, trajectory = resonant
    rows = [
        np.searchsorted(trajectory.time, recording.time)
        for recording in record(resonant, samples=5000, replicates=3)
    ]
    for drawn in rows:
        assert len(drawn) == 5000
        assert np.all(np.diff(drawn) > 0)
        # spread over the whole record: a third of it holds a third of them
        assert abs(np.mean(drawn < 10000) - 1 / 3) < 5 * np.sqrt(2 / 9 / 5000)
    assert not any(np.array_equal(a, b) for a, b in combinations(rows, 2))


def test_replicates_and_cells_are_independent(resonant):
    _, trajectory = resonant
    drawn = record(resonant, replicates=3)
    drawn += record(resonant, name=(*NAME[:2], "noise_0.1"), replicates=1)
    for a, b in combinations([recording.values - trajectory.states for recording in drawn], 2):
        correlation = np.mean(a / a.std(axis=0) * (b / b.std(axis=0)), axis=0)
        assert np.abs(correlation).max() < 5 / np.sqrt(len(a))


@pytest.mark.parametrize("samples", [30001, 1000])
def test_draws_depend_on_seed_and_name_only(resonant, samples):
    few, many = (record(resonant, samples=samples, replicates=n) for n in (2, 5))
    assert few == many[:2]  # more replicates change none of the first
    assert few[0] != record(resonant, samples=samples, seed=2)[0]
    assert few[0] != record(resonant, samples=samples, name=("non_resonant", *NAME[1:]))[0]


def test_names_do_not_run_together():
    draws = {
        tuple(make_generator(1, *names).integers(2**32, size=4))
        for names in (("a", "b", 1), ("a", "b", 11), ("ab", 1), ("a", "b1"), ("b", "a", 1))
    }
    assert len(draws) == 5


@pytest.mark.parametrize("protocol", ["derivative", "state", "acceleration"])
@pytest.mark.parametrize("samples", [30001, 1000])
def test_recordings_come_back_from_files(resonant, tmp_path, protocol, samples):
    written = [(each,) for each in record(resonant, protocol=protocol, samples=samples)]
    for name in ("a.npz", "b.npz"):
        write_recordings(tmp_path / name, written)
    assert list(map(tuple, read_recordings(tmp_path / "a.npz"))) == written
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_several_releases_in_one_replicate(resonant, tmp_path):
    motions = [moved(*resonant), moved(*resonant, factor=2)]
    both, first = (recordings_of(motions, recordings=count, **DRAWN) for count in (2, 1))
    write_recordings(tmp_path / "a.npz", both)
    for pair, (alone,), again in zip(both, first, read_recordings(tmp_path / "a.npz"), strict=True):
        assert pair[0] == alone  # a further release changes nothing of the first
        twice = motions[1].states
        check_noise(pair[1].values - twice, 0.05 * twice.std(axis=0))
        assert tuple(pair) == tuple(again)
