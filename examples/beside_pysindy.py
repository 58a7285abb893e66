"""The same noisy recordings by pysindy and by `MaximumLikelihood`: the table of a page of docs/.

    OPENBLAS_NUM_THREADS=1 python beside_pysindy.py    # prints it; some minutes
    OPENBLAS_NUM_THREADS=1 python beside_pysindy.py Duffing  # of one system

What a user of pysindy has to choose is chosen with the truth, as no user can: of each recording the
threshold and the window that give the most right terms, and of those the smallest error. Smoothing
windows and test functions of the weak form are tried in three widths, thresholds in 20 sizes.
"""

import sys
import time
import warnings
from collections.abc import Callable, Iterator

import numpy as np
import pysindy as ps

import galloping

LEVELS = (0.01, 0.05, 0.1)  # of the noise, in standard deviations of each state
THRESHOLDS = np.geomspace(0.003, 3.0, 20)
SMOOTHED = (11, 21, 41)  # samples
WIDTHS = (0.01, 0.025, 0.05)  # of the recording, half of a test function
DEGREE = 3

# equations, first state, duration in s, samples a second, input
SYSTEMS: dict[str, tuple[str, list[float], float, int, Callable | None]] = {
    "Lorenz": (
        "x = 10 y - 10 x; y = 28 x - x z - y; z = x y - 2.667 z", [-8, 7, 27], 20, 100, None
    ),
    "Duffing": ("q = dq; dq = -q - 0.1 dq - q^3", [2, 0], 40, 25, None),
    "van der Pol": ("q = dq; dq = -q + 1.5 dq - 1.5 q^2 dq", [0.5, 0], 40, 25, None),
    "driven Duffing": (
        "q = dq; dq = -q - 0.2 dq - 0.5 q^3 + 0.8 F", [0.5, 0], 60, 25,
        lambda t: np.sin(1.2 * t) + 0.5 * np.sin(0.37 * t),
    ),
}  # fmt: skip


def judge(found: np.ndarray, true: np.ndarray) -> tuple[int, float]:
    """How many terms are wrongly there or absent, and the median error of the true ones, in %."""
    present = true != 0
    wrong = np.count_nonzero((np.nan_to_num(found) != 0) != present)
    errors = np.abs(np.nan_to_num(found)[present] / true[present] - 1)
    return int(wrong), 100 * float(np.median(errors))


class BestThreshold(ps.STLSQ):
    """Sequential thresholding with the threshold that is best for the truth."""

    def __init__(self, true: np.ndarray, sought: list[int]) -> None:
        super().__init__()
        self.true, self.sought = true, sought

    def fit(self, x: np.ndarray, y: np.ndarray, **options: object) -> "BestThreshold":
        def tried(threshold: float) -> tuple[int, float]:
            self.threshold = threshold
            super(BestThreshold, self).fit(x, y, **options)
            return judge(self.coef_[self.sought], self.true[self.sought])

        tried(min(THRESHOLDS, key=tried))
        return self


def pysindy_options(method: str, t: np.ndarray) -> Iterator[dict]:
    """Options of pysindy's model, of each width that is tried."""
    library = ps.PolynomialLibrary(DEGREE)
    if method == "as it comes":
        yield {"feature_library": library}
    elif method == "smoothed":
        for window in SMOOTHED:
            smoother = {"window_length": window}
            rates = ps.SmoothedFiniteDifference(smoother_kws=smoother)
            yield {"feature_library": library, "differentiation_method": rates}
    else:
        for width in WIDTHS:
            np.random.seed(0)  # places of the test functions
            half = [width * (t[-1] - t[0])]
            weak = ps.WeakPDELibrary(library, spatiotemporal_grid=t, K=200, p=4, H_xt=half)
            yield {"feature_library": weak}


def by_pysindy(method, x, t, u, true, sought):
    """Coefficients, those that are best for the truth but for `as it comes`; time of one fit, s."""
    found, spent = [], []
    for options in pysindy_options(method, t):
        optimizer = ps.STLSQ() if method == "as it comes" else BestThreshold(true, sought)
        found.append(np.asarray(ps.SINDy(optimizer, **options).fit(x, t=t, u=u).coefficients()))
        begun = time.process_time()
        ps.SINDy(ps.STLSQ(threshold=optimizer.threshold), **options).fit(x, t=t, u=u)
        spent.append(time.process_time() - begun)
    return min(found, key=lambda own: judge(own[sought], true[sought])), np.median(spent)


def by_likelihood(names, x, t, u):
    """Coefficients by maximum likelihood as it comes, and the time, s."""
    begun = time.process_time()
    model = galloping.MaximumLikelihood(feature_names=names).fit(x, t, u)
    return model.coef_, time.process_time() - begun


RECORDINGS = 5  # of each system and level, each with other noise
METHODS = ("as it comes", "smoothed", "weak form")  # of pysindy
OURS = "maximum likelihood"


def main(*systems: str) -> None:
    """Print the table, of all systems or those named."""
    columns = [*(f"pysindy, {method}" for method in METHODS), OURS]
    print_row("System", "Noise", *columns)
    print_row(*["---"] * (len(columns) + 2))
    times: dict[str, list[float]] = {method: [] for method in columns}
    for name in systems or SYSTEMS:
        text, start, duration, rate, force = SYSTEMS[name]
        t = np.arange(duration * rate) / rate
        model = galloping.parse_model(text, ["F"] if force else ())
        driving = {"F": galloping.Input(t, force(t))} if force else None
        motion = galloping.simulate(model, start, t, driving).states
        u = force(t)[:, np.newaxis] if force else None
        library = galloping.polynomial_library(len(model.names), DEGREE)
        true = model.on_library(library).coefficients
        # of dq/dt = dq nothing is counted: maximum likelihood knows it by the names of the states
        sought = [k for k, state in enumerate(model.states) if f"d{state}" not in model.states]
        by_likelihood(model.states, motion + 0.01 * np.sin(99 * motion), t, u)  # compiles
        for level in LEVELS:
            judged: dict[str, list[tuple[int, float]]] = {method: [] for method in columns}
            taken: dict[str, list[float]] = {method: [] for method in columns}
            for seed in range(RECORDINGS):
                rng = np.random.default_rng([seed, len(name)])
                x = motion + level * motion.std(axis=0) * rng.standard_normal(motion.shape)
                answers = {
                    f"pysindy, {method}": by_pysindy(method, x, t, u, true, sought)
                    for method in METHODS
                    if u is None or method != "weak form"  # which is not set up for inputs here
                }
                answers[OURS] = by_likelihood(model.states, x, t, u)
                for method, (found, spent) in answers.items():
                    judged[method].append(judge(found[sought], true[sought]))
                    taken[method].append(spent)
            cells = []
            for each in judged.values():
                right = sum(wrong == 0 for wrong, _ in each)
                errors = [error for _, error in each]
                cells.append(f"{right}, {np.median(errors):.2g} %" if each else "")
            print_row(name, f"{100 * level:g} %", *cells)
            for method, own in taken.items():
                times[method] += [float(np.median(own))] if own else []
    print_row(
        "time of a fit", "", *(f"{min(own):.1g} to {max(own):.1g} s" for own in times.values())
    )


def print_row(*cells: str) -> None:
    """Print a row of the table."""
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # of pysindy, where a threshold leaves no term
    main(*sys.argv[1:])
