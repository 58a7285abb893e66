"""The Silverbox, an electronic oscillator that was measured: its model, where it was not fitted.

    python silverbox.py SNLS80mV.csv ["poly(y, dy; 3) + u"]

The file is of the Silverbox benchmark (T. Wigren and J. Schoukens, European Control Conference
2013), https://www.nonlinearbenchmark.org; the repository forgi86/pytorch-ident has a copy in
examples/statespace/silverbox/SilverboxFiles. It is not part of this project. Input V1 and output V2
are in V, at 610.35 Hz: the first 40,500 samples are an arrow, whose amplitude grows, the rest ten
realisations of a multisine.
"""

import sys
from itertools import pairwise
from time import process_time

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

import galloping

RATE, ARROW, MULTISINES = 10**7 / 2**14, 40_500, 10  # Hz, samples
FITTED = 0, 1, 2, 3  # multisines
START = 200  # samples, that tell where a motion begins
LIBRARY = "1 + y + dy + y^2 + y^3 + u"


def recording(part: pd.DataFrame) -> galloping.Recording:
    time = np.arange(len(part)) / RATE
    columns = {"t": time, "y": part["V2"], "dy": np.full(len(part), np.nan), "u": part["V1"]}
    return galloping.Recording.from_frame(columns, inputs=["u"])


def error(found: galloping.IdentifiedModel, of: galloping.Recording) -> np.ndarray:
    """(n,) V, what a free run misses, its start told by the first samples."""

    def missed(start, rows):
        moved = found.simulate(start, of.time[rows], of.inputs)
        return moved.states[:, 0] - of.values[rows, 0]

    first = [of.values[0, 0], np.gradient(of.values[:3, 0], of.time[:3])[0]]
    start = least_squares(missed, first, x_scale=[0.01, 4.0], args=(slice(0, START),)).x
    return missed(start, slice(None))


table = pd.read_csv(sys.argv[1], usecols=["V1", "V2"])
edges = np.linspace(ARROW, len(table), MULTISINES + 1).astype(int)
multisines = [recording(table[a:b]) for a, b in pairwise(edges)]
terms, _ = galloping.library([*sys.argv[2:], LIBRARY][0], ["y", "dy"], ["u"])
began = process_time()
found = galloping.maximum_likelihood([multisines[k] for k in FITTED], terms)
print(f"{found}\nfitted in {process_time() - began:.1f} s of the processor")
for k in (8, 9):
    print(f"multisine {k + 1}: {1e3 * np.sqrt(np.mean(error(found, multisines[k]) ** 2)):.3f} mV")
arrow = error(found, recording(table[:ARROW]))
for count in (30_000, ARROW):
    print(f"arrow, first {count} samples: {1e3 * np.sqrt(np.mean(arrow[:count] ** 2)):.3f} mV")
