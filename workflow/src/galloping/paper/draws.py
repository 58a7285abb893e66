"""Draws of the paper's study at one setting of what it leaves out, a hundred times as fast.

Recordings are drawn as what least squares sees of them (`noise`). All else is the study's: its
thresholds, its simulator, its scores.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from galloping.cycles.family import initial_state
from galloping.evaluation.score import UNKNOWN, Truth, evaluate
from galloping.identification.model import IdentifiedModel
from galloping.identification.options import IDENTIFIED, KNOWN
from galloping.identification.sparse import stlsq
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.regression import Regression
from galloping.measurement.measuring import Motion, channel_scale
from galloping.names import NOISE, SUBSET
from galloping.paper.noise import PROTOCOLS
from galloping.physics.equations import model
from galloping.physics.galerkin import coefficients
from galloping.polynomial import extended, library
from galloping.seeds import generator
from galloping.simulation import Simulator, time_grid

COLUMNS = {"raw": stlsq.raw, "normalised": stlsq.normalised}  # of the library, for thresholds
PATH_LENGTH = 30  # candidate thresholds, where the data choose
AT_ONCE = 25  # draws whose motions are kept in memory


@dataclass(frozen=True)
class Amounts:
    """What is recorded: whole records at `levels`, and subsets of `points` at `subset_level`."""

    levels: Sequence[float] = (0.01, 0.03, 0.05, 0.1)
    points: Sequence[int] = (1000, 5000, 10000, 30000)
    subset_level: float = 0.05
    duration: float = 300.0
    sampling_rate: float = 100.0
    steady_window: tuple[float, float] = (200.0, 300.0)

    @property
    def cells(self) -> list[tuple[str, float, int]]:
        """(kind, level, points) of each; the number of points of a whole record included."""
        whole = len(time_grid(self.duration, self.sampling_rate))
        cells = [(NOISE, level, whole) for level in self.levels]
        return cells + [(SUBSET, self.subset_level, points) for points in self.points]


def line_motion(case: Mapping, duration: float, sampling_rate: float) -> tuple[Motion, object]:
    """The motion of a case from its release, and the model that it is of."""
    line = model(coefficients(case))
    time = time_grid(duration, sampling_rate)
    moved = Simulator(line.states, line.terms)(line, np.array(initial_state(case)), time)
    return Motion(line.states, time, moved.states, line(moved.states), moved.status), line


def paper_draws(
    case: Mapping,
    *,
    draws: int,
    seed: int,
    name: Sequence[str],
    threshold: float | None,
    columns: str = "raw",
    kinematics: str = IDENTIFIED,
    protocol: str = "derivative",
    relative: bool = False,
    degree: int = 3,
    amounts: Amounts,
) -> pd.DataFrame:
    """Scores of the paper's method over draws of the noise, and of the samples of subsets.

    case: as of `study.cells.Case.released`. threshold: one number for all terms, or None to choose
    each equation's by EBIC. columns: `raw` or `normalised`, what thresholds act on. kinematics:
    `identified` as any equation, or `known`. protocol: of PROTOCOLS. relative: whether levels are
    in standard deviations of each noisy channel. A draw depends on `seed`, `name`, its cell and its
    number only.
    Columns kind, level, points, draw, then those of `evaluation.score.score`. Without noise all
    draws are equal, and there is one.
    """
    motion, line = line_motion(case, amounts.duration, amounts.sampling_rate)
    terms = library(len(line.states), degree)
    true = line.on_library(extended(terms, line))
    truth = Truth(true, motion.time, motion.states, amounts.steady_window, motion.status)
    noise, scale = PROTOCOLS[protocol]
    noisy = noise(motion, terms, channel_scale(motion, relative)[scale])
    known = true.coefficients[:, : len(terms)] if kinematics == KNOWN else None
    unbounded = np.full((1, *true.coefficients.shape), np.nan)

    def identified(kind: str, level: float, points: int, draw: int) -> IdentifiedModel:
        rng = generator(seed, "paper", *name, kind, f"{level:.12g}", points, draw)
        (reduced,) = noisy.draw(level, points, rng).regressions(line.states, terms)
        return identify(reduced, threshold=threshold, columns=columns, known=known)

    def rows() -> Iterator[dict]:
        for kind, level, points in amounts.cells:
            numbers = range(draws if level > 0 or kind == SUBSET else 1)
            for start in range(0, len(numbers), AT_ONCE):
                part = numbers[start : start + AT_ONCE]
                models = [identified(kind, level, points, draw) for draw in part]
                scored, _ = evaluate(truth, {"paper": models}, unbounded)
                for draw, row in zip(part, scored, strict=True):
                    row = {k: v for k, v in row.items() if k not in ("method", "replicate")}
                    yield {"kind": kind, "level": level, "points": points, "draw": draw, **row}

    return pd.DataFrame(rows())


def identify(
    reduced: Regression, *, threshold: float | None, columns: str, known: np.ndarray | None = None
) -> IdentifiedModel:
    """The paper's method on a regression; keywords as of `paper_draws`.

    known: (n_states, n_terms), from which the kinematic equations are taken, or None where they are
    identified too.
    """
    evidence = Regressions(reduced, reduced)
    try:
        found = COLUMNS[columns](evidence, threshold=threshold, path_length=PATH_LENGTH)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        return IdentifiedModel.refused(reduced.states, reduced.terms, str(error).splitlines()[0])
    if known is None:
        return found
    matrix = found.model.coefficients.copy()
    rows = [row for row in range(len(matrix)) if row not in UNKNOWN]
    matrix[rows] = known[rows]
    return replace(found, model=replace(found.model, coefficients=matrix))
