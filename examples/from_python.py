"""The same from Python: a DataFrame becomes a recording, a model and a motion."""

from pathlib import Path

import pandas as pd

import galloping

table = pd.read_csv(Path(__file__).with_name("span.csv")) / 1e3  # mm to m
frame = pd.DataFrame({"t": 1e3 * table["t [s]"], "dq_v": None, "dq_w": None}, dtype=float)
for d in "vw":  # the first sine mode, from sensors at the quarter points
    quarters = (table[f"{d}75 [mm]"] + table[f"{d}225 [mm]"]) / 2**0.5
    frame[f"q_{d}"] = (quarters + table[f"{d}150 [mm]"]) / 2
recording = galloping.Recording.from_frame(frame[["t", "q_v", "q_w", "dq_v", "dq_w"]])
identified = galloping.maximum_likelihood(recording, galloping.polynomial_library(4, 3))
print(identified)
motion = identified.simulate(identified.initial_states[0], frame["t"])
print(motion.states[-1])
