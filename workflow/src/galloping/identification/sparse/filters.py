"""pysindy's smoothers, slopes and test functions as kernels, so that each costs one product.

On equally spaced samples all of them are linear filters. Their kernels are what pysindy's own
classes answer to an impulse; applying those classes to every sample would take 10^3 times longer.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

import numpy as np
import pysindy as ps
from scipy.fft import irfft, next_fast_len, rfft


@contextmanager
def seeded(rng: np.random.Generator) -> Iterator[None]:
    """Seeds NumPy's global generator, from which pysindy draws, by `rng`; and puts it back."""
    state = np.random.get_state()
    np.random.seed(rng.integers(2**32))
    try:
        yield
    finally:
        np.random.set_state(state)


@lru_cache(maxsize=64)
def savitzky_golay(window: int, order: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Kernels (window,) of the smoothed state and of its slope.

    window: odd number of samples, order: of the local polynomial, step: between samples, s.
    The state is that of SmoothedFiniteDifference, the slope that of SINDyDerivative.
    """
    half = window // 2
    impulse = np.zeros((4 * half + 1, 1))
    impulse[2 * half] = 1
    answered = slice(half, 3 * half + 1)  # where no window is cut by an end
    smoother = ps.SmoothedFiniteDifference(
        smoother_kws={"window_length": window, "polyorder": order}
    )
    smoother(impulse, t=1.0)
    slope = ps.SINDyDerivative(
        kind="savitzky_golay", left=half, right=half, order=order, iwindow=True,
        periodic=True, period=len(impulse) / half,  # or the windows at the ends hold too little
    )  # fmt: skip
    # in half windows as unit of time: well conditioned
    slopes = np.asarray(slope(impulse, t=1 / half)) / half
    return np.asarray(smoother.smoothed_x_)[answered, 0], slopes[answered, 0] / step


@lru_cache(maxsize=64)
def weak_form(half: int, order: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Kernels (2 half + 1,) of the integrals of a library and of a state's derivative.

    half: of the test function's length, in samples; order: of its ends. Both are WeakPDELibrary's
    weights of one test function, which are the same wherever it stands.
    """
    # the cell holds these 2 half + 1 samples wherever its centre is drawn
    with seeded(np.random.default_rng(0)):
        library = ps.WeakPDELibrary(
            function_library=ps.PolynomialLibrary(degree=1),
            spatiotemporal_grid=step * np.arange(-half - 1, half + 2),
            K=1,
            H_xt=step * (half + 0.5),
            p=order,
        )
    return library.fullweights0[0][::-1], -library.fulltweights[0][::-1]


class Filtered:
    """Columns (n, m) that many kernels will be applied to.

    longest: samples of the longest kernel.
    """

    def __init__(self, columns: np.ndarray, longest: int) -> None:
        self._length = next_fast_len(len(columns) + longest, real=True)
        self._spectrum = rfft(np.ascontiguousarray(columns.T), self._length)

    def __call__(self, kernel: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """The convolution with a kernel of odd length, centred on `rows`: (len(rows), m)."""
        full = irfft(self._spectrum * rfft(kernel, self._length), self._length)
        return full[:, rows + len(kernel) // 2].T
