"""What a user's script may hand over, beside the examples of the pages; it is checked, not run."""

from datetime import datetime
from typing import assert_type

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import galloping

line = galloping.derive(wind={"speed": 14}, line={"tension": 26000})
assert_type(line, galloping.PolynomialModel)
motion = galloping.simulate(line, (0.1, 0.1, 0, 0), [0, 0.1, 0.2])
assert_type(motion.states, NDArray[np.float64])
recording = galloping.measure(line, motion, level=0.05)
terms, allowed = galloping.library(["q + dq", "dq^2"], ["q", "dq"])
found = galloping.maximum_likelihood([recording], terms, allowed=allowed)
assert_type(found, galloping.IdentifiedModel)
assert_type(galloping.weak_gls(recording, terms), galloping.IdentifiedModel)
assert_type(found.standard_errors, NDArray[np.float64])
assert_type(galloping.summarise(found, recording), galloping.Summary)
assert_type(galloping.forecast(found, recording, np.arange(3)), galloping.Forecast)
assert_type(galloping.assess(found, {"U": [4, 8]}), galloping.Assessment)
assert_type(galloping.cramer_rao_bound(line, [0, 0, 1, 0], motion.time, [1, 1, 1, 1]),
            NDArray[np.float64])  # fmt: skip
frame = pd.DataFrame({"t": [0, 0.1], "q": [0, 1.5], "U": [12, 13]})
assert_type(galloping.Recording.from_frame(frame, inputs=["U"]), galloping.Recording)
galloping.Recording.from_frame({"t": [0, 1], "q": np.zeros(2)}, time="t")
dates = [datetime(2026, 1, 30), datetime(2026, 1, 31)]
recording = galloping.Recording(
    dates, ["q", "dq"], [[0, 1.5], [1, 2]], known_noise=[[0.1, 1], [1, 1]],
    unknown_offsets=[False, True], inputs={"U": galloping.Input(dates, [12, 13.5], "linear")},
)  # fmt: skip
galloping.Recording(frame["t"], ("q", "U"), frame[["q", "U"]], rates=np.zeros((2, 2)))
model = galloping.PolynomialModel(["x"], [(1, 0), (0, -1)], [[-1, 0.5]], ["U"])
galloping.PolynomialModel(("x",), [[1], [2]], np.zeros((1, 2))).equations()
galloping.PolynomialModel(line.states, terms, np.zeros((4, len(terms))))
start: list[float] = [0, 1.5]
estimator = galloping.MaximumLikelihood("q + dq", known=["dq: dq < 0"], feature_names=["q", "dq"])
assert_type(estimator.fit(np.zeros((3, 2)), 0.1), galloping.MaximumLikelihood)
estimator.fit([np.zeros((3, 2)), np.zeros((4, 2))], t=[[0, 1, 2], [0, 1, 2, 3]], x_dot=None)
estimator.fit([[0, 1.5], [1, 2]], [0, 1], [[1], [2]])
estimator.fit(frame, u=["U"]).fit([frame, frame], u="U").fit(frame, t="t").fit(recording)
estimator.fit({"t": [0, 1], "q": [0, 1]}, u={"U": galloping.Input(dates, [12, 13.5])})
assert_type(estimator.coefficients(), pd.DataFrame)
assert_type(estimator.simulate([0, 1], [0, 1], {"U": 12}), NDArray[np.float64])
estimator.simulate(start, np.arange(3), lambda t: [2 * t])
assert_type(estimator.score([frame], u=["U"]), float)
assert_type(estimator.model_, galloping.IdentifiedModel)
estimator.print(flush=True)
assert_type(motion.to_frame(), pd.DataFrame)
galloping.plot_phase(estimator, states=["q", "dq"]).savefig("phase.png")
galloping.plot_fit(found, [recording]).savefig("fit.png")
galloping.plot_forecast(found, recording, np.arange(3), inputs={"U": 12}).savefig("ahead.png")
assert_type(found.simulate(start, recording.time, {"U": 12}).status, str)
