"""Motion in random forces that has more modes than coordinates: the slowest modes alone are
modelled, and what is faster is taken out of the recordings before. Where the first mode too many is
too close for that, it stays in the model, as a force that swings.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.special import chdtri

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.observations import Code, Finding
from galloping.identification.preparation.screening import prepared
from galloping.identification.random_forces.channels import Channels
from galloping.identification.random_forces.low_pass import FLAT, ROLL_OFF, what_is_left
from galloping.identification.random_forces.start import on_grids, spectra
from galloping.model.modes import Modes
from galloping.recording.samples import Recording

# What modes sweep that stay, and that do not, in their frequencies; and where between these, as a
# share in logarithms, the filter ends: far from both, or, of broad modes, far from the fast one.
SWEPT, WITHIN = (1.04, 0.93), (0.5, 0.1)
# Of a spectrum, times the median of the frequencies around it, that a mode is: noise in means of
# four bins is so once in ten million. And modes that are closer are taken for one.
STANDS, AROUND, APART = 6.0, 1.25, 1.1
# Samples in which a motion has a size, and deviation of such sizes, in their mean, of one that goes
# up and down: 0.3 to 0.5 of a narrow band of Gaussian noise, below 0.1 of a lasting swing.
SIZED, WAVERING = 8, 0.2
# Times a mode, at which a filter may part the next one, and at which it bears on both dampings.
FAR_APART, CLOSE = (1.6, np.inf), (1.0, 1.6)
FAR = 3.0  # times the fastest mode, where a filter ends that no further mode asks for
MOST_KEPT = 0.5  # of the samples, that it leaves: else these are taken as they are
PERIODS = 10  # of a mode, that a recording holds at least
BESIDES = 3  # modes that a model has beside those of its coordinates, at most
# Damping ratio from which on a mode may be two that overlap, share of the line that chance allows,
# which one in three sound models leave, and a chance at which that is plain at any frequency.
BROAD, LESS_WHITE, LIKELIER = 0.02, 0.75, 1e-7


# The model of recordings whose shortest period, s, is the second argument, and which have as many
# modes more than coordinates as the third one says.
Find = Callable[[list[Recording], float, int], IdentifiedModel | NoModel]


@dataclass(frozen=True)
class SeveralModes:
    """Recordings that may have more modes than coordinates; period: s, as of `screening.prepared`.

    Each model that is found swings as the modes do that it is of; there is none where random forces
    need not have moved the recordings, and beside inputs. The diagnostic `below` says from which
    on, Hz, motion was left out.
    """

    recordings: list[Recording]
    period: float

    @cached_property
    def modes(self) -> list[float]:
        """Hz, the slowest first; none beside inputs, whose frequencies are no modes."""
        return [] if self.recordings[0].inputs else _modes(self.recordings)

    @cached_property
    def channels(self) -> Channels:
        """What the recordings measure."""
        return Channels.of(self.recordings)

    def slowest(
        self, find: Find, apart: tuple[float, float] = FAR_APART
    ) -> Iterator[IdentifiedModel]:
        """Models of as many of the slowest modes as coordinates, where there are more.

        apart: times the last of these modes, between which the next one is.
        """
        own = len(self.channels.pairs)
        return self._of_modes(find, [own] if len(self.modes) > own else [], apart)

    def more(self, find: Find) -> Iterator[IdentifiedModel]:
        """The same of more modes than coordinates: all that there are and one that is taken for
        another of them, or the slowest. Accelerations show forces beyond all modes, where these are
        no longer white: what is far beyond is left out, also where there are no more modes than
        coordinates. So it is where samples are many times as fast as the modes.
        """
        own, every = len(self.channels.pairs), len(self.modes)
        more = range(own + 1, min(own + BESIDES, every + 1) + 1)
        same = [own] if self.channels.rates and own >= every else []
        counts = [*same, *sorted(more, key=lambda k: (k < every, k))]
        return self._of_modes(find, counts, (1.0, np.inf))

    def _of_modes(
        self, find: Find, counts: Iterable[int], apart: tuple[float, float]
    ) -> Iterator[IdentifiedModel]:
        """Models of as many of the slowest modes as each of `counts`; apart: as of `_edges`."""
        step = max(each.step for each in self.recordings)
        fastest = (1.0 + ROLL_OFF) / (2.2 * step)  # that a filter ends at
        for k in counts:
            for below in _edges(self.modes, k, fastest, apart):
                found = attempt(partial(self._below, find, k, below))
                if not isinstance(found, NoModel):
                    yield found

    def _below(self, find: Find, k: int, below: float) -> IdentifiedModel | NoModel:
        """The model of the slowest k modes, where what is faster than `below`, Hz, is left out."""
        recordings, modes = self.recordings, self.modes
        besides = k - len(self.channels.pairs)
        slow = what_is_left(recordings, below)
        if not _size_varies(slow):
            return NoModel()
        before, kept = (sum(len(one.time) for one in each) for each in (recordings, slow))
        is_whole = k >= len(modes) and not (self.channels.rates or kept < MOST_KEPT * before)
        given = (recordings, self.period) if is_whole else (slow, prepared(slow)[2])
        found = find(*given, besides)
        if isinstance(found, NoModel):
            return found
        if not _swings_at(found, modes[:k]):
            return NoModel()
        found = with_split_mode(found, *given, besides, find)
        return found if is_whole else _said(found, modes[k:], below)


def may_be_two(found: IdentifiedModel) -> bool:
    """Whether a mode of a model is so broad that it may be two, and what it leaves less white than
    that of most sound models. Beside inputs no further mode is sought.
    """
    if found.model.inputs:
        return False
    told = found.diagnostics
    beside = (each.damping for each in found.resonances if each.is_mode)
    return max(*_at_rest(found).damping, *beside) > BROAD and (
        told["innovations"] > 0.5 * (1.0 + told["innovations_allowed"])
        or told["innovations_line"] > LESS_WHITE * told["innovations_line_allowed"]
    )


def with_split_mode(
    found: IdentifiedModel, recordings: list[Recording], period: float, besides: int, find: Find
) -> IdentifiedModel:
    """The model that `find` has found or, where a mode of it is two, one with a mode more.

    Of two modes that overlap, a broad one in their middle leaves innovations that are nearly white;
    the model of both is plainly likelier.
    """
    if found.status != "ok" or besides == BESIDES or not may_be_two(found):
        return found
    more = find(recordings, period, besides + 1)
    if isinstance(more, NoModel) or more.status != "ok":
        return found
    if not all(each.is_mode for each in more.resonances):
        return found
    gain = more.diagnostics["log_likelihood"] - found.diagnostics["log_likelihood"]
    freedom = 3 + len(found.forces.nonzero()[0]) + len(found.resonances)
    return more if 2.0 * gain > chdtri(freedom, LIKELIER) else found


def _edges(
    modes: list[float], k: int, fastest: float, apart: tuple[float, float]
) -> Iterator[float]:
    """Where the filter may end that leaves the first k of some modes, Hz, at `fastest` at most.

    apart: times the last one, between which the next one is, to be filtered out.
    """
    if 0 < k < len(modes):
        least, most = SWEPT[0] / FLAT * modes[k - 1], SWEPT[1] * modes[k]
        if least <= most and apart[0] < modes[k] / modes[k - 1] <= apart[1]:
            for share in WITHIN:
                yield float(f"{least ** (1.0 - share) * most**share:.3g}")
    elif modes:
        yield float(f"{min(FAR * modes[-1], fastest):.3g}")


def _said(found: IdentifiedModel, faster: list[float], below: float) -> IdentifiedModel:
    """With what was left out: modes, Hz, and all beyond a frequency, Hz."""
    if faster:
        modes = ", ".join(f"{each:.2g}" for each in faster)
        left_out = Finding.of(Code.FASTER_MODES_LEFT_OUT, modes=modes, below_hz=below)
    else:
        left_out = Finding.of(Code.FASTER_LEFT_OUT, below_hz=below)
    found = replace(found, diagnostics={**found.diagnostics, "below": below})
    return found.with_findings(left_out)


def _swings_at(found: IdentifiedModel, modes: list[float]) -> bool:
    """Whether each oscillation of the linear part of a model is at one of some modes, Hz."""
    beside = (each.frequency for each in found.resonances if each.is_mode)
    own = np.array([*_at_rest(found).omega, *beside])
    ratios = own[:, np.newaxis] / (2.0 * np.pi * np.array(modes))
    return bool(np.all(np.abs(np.log(ratios)).min(axis=1) < 1.5 * np.log(APART)))


def _at_rest(found: IdentifiedModel) -> Modes:
    """Those of the linear part of a model."""
    return found.model.small_motions(np.zeros(len(found.model.states)))


def _size_varies(recordings: list[Recording]) -> bool:
    """Whether the size of every channel goes up and down, as that of a limit cycle does not, of
    which the filter leaves no harmonics to tell it by.
    """
    channels, sizes = Channels.of(recordings), []
    for each in recordings:  # with a little more than two samples in a period
        parts = np.array_split(channels.samples(each), max(len(each.time) // SIZED, 1))
        sizes += [np.std(part, axis=0) for part in parts if np.isfinite(part).all()]
    return bool(sizes) and bool(np.all(np.std(sizes, axis=0) > WAVERING * np.mean(sizes, axis=0)))


def _modes(recordings: list[Recording]) -> list[float]:
    """Where the mean spectrum of any channel has peaks, Hz, the slowest first."""
    step, grids = on_grids(recordings)
    lengths = np.array(list(map(len, grids)))
    alike = [
        np.pad(grid, ((0, lengths.max() - len(grid)), (0, 0)), constant_values=np.nan)
        for grid in grids
    ]  # of one length, and so with spectra at the same frequencies
    omega, powers = spectra(alike, step)
    powers = powers.reshape(len(grids), -1, powers.shape[1])
    power = np.average(powers, axis=0, weights=lengths)
    if not len(power):
        return []
    frequency = omega[: len(power)] / (2.0 * np.pi)
    around = [np.median(power[own], axis=0) for own in _near(frequency, AROUND)]
    height = np.max(power / np.maximum(around, np.finfo(float).tiny), axis=1)
    highest = np.array([height[own].max() for own in _near(frequency, APART)])
    told = frequency * step * lengths.max() > PERIODS
    return frequency[told & (height == highest) & (height > STANDS)].tolist()


def _near(frequency: np.ndarray, times: float) -> list[slice]:
    """Of each frequency (n,), increasing, those that are less than `times` as large or as small."""
    first = np.searchsorted(frequency, frequency / times)
    last = np.searchsorted(frequency, frequency * times, side="right")
    return list(map(slice, first, last))
