"""Writes span.csv: what three cameras and an accelerometer record of a galloping span.

The span is the continuous line on seven modes a direction: no polynomial model contains it.
"""

from pathlib import Path

import numpy as np

from galloping.configuration.load import load, plain
from galloping.line.continuous import (
    SENSOR_POSITIONS,
    continuous_line,
    displaced_state,
    sensor_readings,
    simulate,
)

RATE, BEGIN, END = 25.0, 20.0, 220.0  # Hz, s
NOISE, SHAKE, BIAS, DRIFT = 20.0, 0.06, (0.31, -0.12), 0.05  # mm, m/s^2 and m/s^2, in all

line = continuous_line(plain(load({"cases": {"span": {}}}))["cases"]["span"], sines=7)
places = [share * line.line.span for share in SENSOR_POSITIONS]
time = np.arange(0.0, END, 1 / RATE)
states = simulate(line, displaced_state(line, [0.2, 0.1]), time)
seen = time >= BEGIN
time, states = time[seen] - BEGIN, states[seen]

rng = np.random.default_rng(20)
readings = sensor_readings(line, states, SENSOR_POSITIONS)  # of displacements and velocities
rates = np.array([line.rates(state, line.speed) for state in states])
displacements = 1e3 * readings[:, :, :2].reshape(len(time), -1)
displacements += NOISE * rng.standard_normal(displacements.shape)
acceleration = sensor_readings(line, rates, SENSOR_POSITIONS[1:2])[:, 0, 2:]
acceleration += BIAS + DRIFT * (time / time[-1])[:, None]
acceleration += SHAKE * rng.standard_normal(acceleration.shape)

names = ["t [s]", *(f"{d}{place:.0f} [mm]" for place in places for d in "vw")]
names += ["av150 [m/s^2]", "aw150 [m/s^2]"]
lines = [",".join(names)]
for k, now in enumerate(time):
    if 90.0 < now < 92.5:
        continue  # the logger was off
    cells = [f"{value:.0f}" for value in displacements[k]]
    if 140.0 < now < 141.0:
        cells[2:4] = "", ""  # a camera was blinded
    cells += [f"{value:.2f}" for value in acceleration[k]]
    lines.append(",".join([f"{now:.2f}", *cells]))
Path(__file__).with_name("span.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
