"""The same from Python: a DataFrame becomes a recording, a model, a forecast."""

from pathlib import Path

import numpy as np
import pandas as pd

table = pd.read_csv(Path(__file__).with_name("span.csv"))
frame = pd.DataFrame({"t": table["t [s]"], "dq_v": np.nan, "dq_w": np.nan})
frame["q_v"] = (table["v75 [mm]"] + table["v225 [mm]"]) / 2**1.5 / 1e3 + 0.5e-3 * table["v150 [mm]"]
