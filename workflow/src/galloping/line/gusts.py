"""Stationary random wind: the along-wind speed of atmospheric turbulence.

This module is separate from `continuous`, so that trials with wind alone need not compile it.
"""

import numpy as np


def von_karman(reduced: np.ndarray) -> np.ndarray:
    """Evaluate von Karman's normalised wind spectrum at reduced frequencies.

    This is n S/sigma^2, one-sided, at n L/U, with the frequency n, the spectrum S, the length scale
    L and the wind speed U (von Karman, PNAS 34, 1948).
    """
    return 4.0 * reduced / (1.0 + 70.8 * reduced**2) ** (5.0 / 6.0)


def kaimal(reduced: np.ndarray) -> np.ndarray:
    """Evaluate Kaimal's normalised wind spectrum at reduced frequencies.

    This is n S/sigma^2 at n L/U, as of `von_karman` (Kaimal et al. 1972, in IEC 61400-1).
    """
    return 4.0 * reduced / (1.0 + 6.0 * reduced) ** (5.0 / 3.0)


SPECTRA = {"von_karman": von_karman, "kaimal": kaimal}


def wind_speed(
    time: np.ndarray,
    *,
    mean: float,
    intensity: float,
    length_scale: float,
    spectrum: str,
    rng: np.random.Generator,
) -> np.ndarray:
    """Draw a random history of wind speed (m/s) with a given intensity and spectrum of gusts.

    U(t) = mean (1 + intensity x(t)), x Gaussian, of unit variance. time: (n,) s, equally spaced.
    mean: m/s, over these times, since wind speeds and intensities refer to an averaging interval.
    intensity: standard deviation over mean. length_scale: integral length of the turbulence along
    the wind, m. spectrum: of `SPECTRA`. Harmonics of twice the duration have Gaussian amplitudes
    (Shinozuka and Jan 1972), so that the end does not repeat the beginning. Returns (n,), m/s.
    """
    step = time[1] - time[0]
    harmonics = len(time)
    edges = (np.arange(harmonics + 1) + 0.5) / (2 * harmonics * step)
    density = SPECTRA[spectrum](edges * length_scale / mean) / edges
    variance = np.diff(edges) * (density[1:] + density[:-1]) / 2.0
    amplitude = rng.standard_normal((2, harmonics)) * np.sqrt(variance)
    amplitude[:, -1] = 0.0  # at the Nyquist frequency
    terms = np.concatenate([[0.0], amplitude[0] + 1j * amplitude[1]])
    x = np.fft.irfft(terms, 2 * harmonics)[:harmonics] * harmonics
    return mean * (1.0 + intensity * (x - x.mean()))
