"""Modes that a recording shows and its states leave no room for."""

import numpy as np

from galloping.identification.random_forces.channels import Channels
from galloping.identification.random_forces.start import ABOVE_NOISE, FLOOR, on_grids, spectra
from galloping.recording import Recording

BEYOND = 3.5  # times what a coordinate mostly swings at: cubic terms answer at three times that
MUCH = 0.2  # share of the power of its velocity there, of another motion than its own
PERIODS = 10  # of a swing, that a recording holds at least
LEAST_PEAK = 0.05  # of the highest of a spectrum, to be named
NARROW = 0.1  # share of the faster power that is about the frequencies that are named
NAMED, APART = 3, 0.5  # frequencies that are named, and how far apart, in that of the swings


def unmodelled(recordings: list[Recording]) -> str:
    """Which coordinates move much faster than they swing, and at which frequencies; '' if none."""
    channels, said = Channels.of(recordings), []
    names = channels.names
    if not names:  # a line that diverged has no motion
        return ""
    step, grids = on_grids(recordings)
    omega, power = spectra(grids, step)
    order = np.argsort(omega)
    omega, power = omega[order], power[order]
    slowest = 2.0 * np.pi * PERIODS / (step * max(map(len, grids)))  # slower is a drift
    power -= ABOVE_NOISE * np.median(power[int(FLOOR * len(power)) :], axis=0)
    for name in (channels.states[i] for i in channels.pairs):
        order = next((n for n in range(3) if "d" * n + name in names), None)  # as a derivative
        if order is None:
            continue
        own = np.maximum(power[:, names.index("d" * order + name)], 0.0)
        velocity = own * omega ** (2.0 - 2.0 * order)
        if not np.any(velocity):
            continue
        main = omega[np.argmax(np.where(omega < slowest, 0.0, velocity / omega))]
        faster = np.where(omega > BEYOND * main, velocity, 0.0)
        if faster.sum() < MUCH * velocity.sum():
            continue
        peaks: list[float] = []
        for k in np.argsort(-faster):
            if len(peaks) == NAMED or faster[k] < LEAST_PEAK * faster.max():
                break
            if all(abs(omega[k] - other) > APART * main for other in peaks):
                peaks.append(omega[k])
        near = np.abs(omega[:, None] - np.array(peaks)).min(axis=1) < APART * main
        if faster[near].sum() < NARROW * faster.sum():
            continue  # as of a random walk, whose velocity is white
        hz = ", ".join(f"{peak / (2.0 * np.pi):.2g}" for peak in sorted(peaks))
        said.append(f"{name}, which swings at {main / (2.0 * np.pi):.2g} Hz, moves at {hz} Hz")
    return f"more modes gallop or swing than are modelled: {'; '.join(said)}" if said else ""
