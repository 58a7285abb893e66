"""The random wind has the intensity and the spectrum that it names."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import welch

from galloping.physics.gusts import SPECTRA, wind_speed


@pytest.mark.parametrize("name", SPECTRA)
def test_spectrum_has_unit_variance_and_the_length_scale(name):
    def density(n):
        return SPECTRA[name](n) / n

    variance = quad(density, 1e-9, 1.0)[0] + quad(density, 1.0, np.inf)[0]
    assert variance == pytest.approx(1.0, rel=2e-3)
    # an integral length of one: the density at zero is four lengths
    assert density(1e-9) == pytest.approx(4.0)


@pytest.mark.parametrize("name", SPECTRA)
def test_wind_has_the_named_spectrum(name):
    time = np.arange(2**19) * 0.1
    settings = {"mean": 12.0, "intensity": 0.05, "length_scale": 100.0, "spectrum": name}
    wind = wind_speed(time, **settings, rng=np.random.default_rng(1))
    x = (wind / 12.0 - 1.0) / 0.05
    assert x.mean() == pytest.approx(0.0, abs=0.1)
    assert x.std() == pytest.approx(1.0, rel=0.05)
    frequency, power = welch(x, 10.0, nperseg=4096)
    band = (frequency > 0.01) & (frequency < 2.0)
    reduced = frequency[band] * 100.0 / 12.0
    ratio = power[band] * frequency[band] / SPECTRA[name](reduced)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)
    again = wind_speed(time, **settings, rng=np.random.default_rng(1))
    assert np.array_equal(wind, again)
