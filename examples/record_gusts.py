"""Writes gusts.csv: what a camera at mid-span and an anemometer record of a span in gusts.

The span moves in the two shapes of the model, one in each direction.
"""

from pathlib import Path

import numpy as np

from galloping.configuration.load import load, plain
from galloping.line.continuous import (
    continuous_line,
    displaced_state,
    draw_wind,
    sensor_readings,
    simulate,
)

RATE, END = 12.5, 300.0  # Hz, s
GUSTS = {"intensity": 0.12, "length_scale": 100.0, "spectrum": "von_karman"}  # m
NOISE, OF_WIND = 20.0, 0.05  # mm, m/s

case = plain(load({"cases": {"span": {}}}))["cases"]["span"]
line = continuous_line(case, sines=0)
time = np.arange(0.0, END, 1 / RATE)
rng = np.random.default_rng(30)
speed = draw_wind(line, GUSTS, time, rng)
states = simulate(line, displaced_state(line, [0.2, 0.1]), time, speed)
displacement = 1e3 * sensor_readings(line, states, [0.5])[:, 0, :2]
displacement += NOISE * rng.standard_normal(displacement.shape)
measured = speed + OF_WIND * rng.standard_normal(len(time))

lines = ["t [s],v [mm],w [mm],wind [m/s],air [degC]"]
for k, now in enumerate(time):
    if 120.0 < now < 124.0:
        continue  # the logger was off
    blind = 200.0 < now < 206.0  # the anemometer was
    cells = [f"{now:.2f}", *(f"{value:.0f}" for value in displacement[k])]
    cells += ["" if blind else f"{measured[k]:.2f}", f"{-2.0 + 0.3 * np.sin(now / 60.0):.1f}"]
    lines.append(",".join(cells))
Path(__file__).with_name("gusts.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
