"""Writes ambient.csv: what a camera records of a span that the wind shakes without galloping.

The two modes of the default line in a wind of 2 m/s, in which it would come to rest, and white
forces of turbulence, which nobody measures.
"""

from pathlib import Path

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from galloping.configuration.load import load, plain
from galloping.line.galerkin import derive

WIND, RATE, DURATION = 2.0, 5.0, 1200.0  # m/s, Hz, s
FORCES = np.array([8e-3, 3e-3])  # m/s^2, of q_v and q_w, their roots of covariance in a second
NOISE, CAMERA = 1.0, (350.0, -120.0)  # mm, of a sample; mm, where the camera says the line rests

case = plain(load({}))["cases"]["internal_resonance"]
case["wind"]["speed"] = WIND
model = derive(case).model
system = model.jacobian(np.zeros((1, 4)))[0]
stationary = solve_continuous_lyapunov(system, -np.diag([0.0, 0.0, *FORCES**2]))
step = expm(system / RATE)
root = np.linalg.cholesky(stationary - step @ stationary @ step.T)

rng = np.random.default_rng(30)
time = np.arange(0.0, DURATION, 1 / RATE)
states = np.linalg.cholesky(stationary) @ rng.standard_normal(4)
seen = []
for _ in time:
    seen.append(1e3 * states[:2] + CAMERA + NOISE * rng.standard_normal(2))
    states = step @ states + root @ rng.standard_normal(4)

rows = [f"{now:.1f},{v:.1f},{w:.1f}" for now, (v, w) in zip(time, seen, strict=True)]
text = "\n".join(["time [s],vertical [mm],horizontal [mm]", *rows])
Path(__file__).with_name("ambient.csv").write_text(text + "\n", encoding="utf-8")
