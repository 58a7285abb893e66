"""The same from Python: a DataFrame becomes a recording, a model, and what the summary says of it.

What is left out: the checks of the file that `galloping inspect` makes, the ranges of its columns,
and the files written.
"""

from pathlib import Path

import numpy as np
import pandas as pd

import galloping

table = pd.read_csv(Path(__file__).with_name("span.csv"))
states = ["q_v", "q_w", "dq_v", "dq_w"]
values, rates = np.full((2, len(table), 4), np.nan)
for k, d in enumerate("vw"):  # the first sine mode, from cameras at the quarter points, mm to m
    quarters = (table[f"{d}75 [mm]"] + table[f"{d}225 [mm]"]) / 2**0.5
    values[:, k] = (quarters + table[f"{d}150 [mm]"]) / 2e3
    rates[:, 2 + k] = table[f"a{d}150 [m/s^2]"]  # of the velocities
biased = [False, False, True, True]
recording = galloping.Recording(table["t [s]"], states, values, rates=rates, unknown_offsets=biased)

found = galloping.maximum_likelihood(recording, galloping.polynomial_library(4, degree=3))
summary = galloping.summarise(found, recording)
print(summary)
assert summary.dynamics  # the model is not refused
cycle = summary.dynamics.half_range["q_v"]
print(f"limit cycle of q_v: {cycle.value:.3f} m ({cycle.low:.3f} to {cycle.high:.3f})")
later = recording.time[-1] + np.arange(1, 1501) / 25
ahead = galloping.forecast(summary.found, recording, later)  # its bands as wide as they had to be
print(f"q_v after {ahead.time[-1]:.0f} s: {ahead.low[-1, 0]:.2f} to {ahead.high[-1, 0]:.2f} m")
