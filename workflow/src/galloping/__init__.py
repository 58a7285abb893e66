"""Galloping of iced overhead lines: derive, simulate, measure, identify, evaluate.

`derive` returns the equations of a line; missing keys have the defaults of config/README.md:

>>> import numpy as np
>>> import galloping
>>> line = galloping.derive(wind={"speed": 14}, line={"tension": 26000})
>>> line.states
('q_v', 'q_w', 'dq_v', 'dq_w')

`simulate` computes the motion, and `measure` a recording of it with 5 % noise:

>>> time = np.arange(6001) / 50
>>> motion = galloping.simulate(line, [0.1, 0.1, 0, 0], time)
>>> motion.status
'ok'
>>> recording = galloping.measure(line, motion, protocol="state", level=0.05, seed=7)

`maximum_likelihood` identifies a model from one or several recordings, without the equations:

>>> terms = galloping.polynomial_library(4, degree=3)
>>> found = galloping.maximum_likelihood(recording, terms)
>>> print(found.equations()[0])
d(q_v)/dt = 1 dq_v

A model is saved, loaded and simulated in one line each:

>>> found.save("found.json")
>>> print(galloping.IdentifiedModel.load("found.json").status == found.status)
True
>>> found.simulate([0.1, 0.1, 0, 0], time).states.shape
(6001, 4)

`summarise` computes properties of the line with their intervals. Printed, a summary is what the
command writes to `summary.md`; `draw_fit` and `draw_forecast` draw its figures:

>>> summary = galloping.summarise(found, recording)
>>> assert summary.dynamics  # None without a model, or if no state is a velocity
>>> damping = summary.dynamics.damping["q_v"]  # a share of critical, with its 95 % interval
>>> damping.low <= damping.value <= damping.high < 0  # it gallops
True
>>> galloping.dynamics(found, recording) == summary.dynamics  # the same without the rest
True
>>> ahead = galloping.forecast(found, recording, recording.time[-1] + np.arange(1, 101) / 50)
>>> bool(np.all(ahead.low[:, 0] < ahead.high[:, 0]))  # q_v, the 90 % band of its samples
True

`progress` reports the progress of long computations to a function:

>>> told: list[tuple[str, float]] = []
>>> with galloping.progress(lambda what, share: told.append((what, share))):
...     found = galloping.weak_gls(recording, terms)
>>> told[0][0]
'smooth the recording'

The Cramér-Rao bound is the smallest error of each term that any unbiased method can have:

>>> sigma = 0.05 * motion.states.std(axis=0)
>>> bound = galloping.cramer_rao_bound(line, motion.states[0], time, sigma)
>>> bool(np.nanmin(bound) > 0)
True

A measured wind or force is an input. Terms have exponents for inputs as for states:

>>> gusts = galloping.Input(time, 12 + np.sin(time / 3))
>>> driven = galloping.PolynomialModel(["x"], [(1, 0), (0, 2)], [[-1, 0.01]], inputs=["U"])
>>> galloping.simulate(driven, [0], time, {"U": gusts}).status
'ok'
>>> print(driven.at({"U": 10}).equations()[0])
d(x)/dt = -1 x + 1

Your own data are arrays, lists or a pandas DataFrame; NaN marks missing samples:

>>> own = galloping.Recording(time=[0, 0.1, 0.2], states=["q", "dq"], values=[[0, 1]] * 3)
>>> own = galloping.Recording.from_frame({"t": [0, 0.1, 0.2], "q": [0, 0.1, 0.2]}, time="t")
"""

import ast
from importlib import import_module
from pathlib import Path

__version__ = "0.1.0"

# What the stub imports, name -> module and name there: imported at first use, since some compile.
_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_PUBLIC = {
    alias.asname or alias.name: (node.module, alias.name)
    for node in _STUB.body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> object:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'galloping' has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    return getattr(import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
