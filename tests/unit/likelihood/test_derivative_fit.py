"""Exact states with noisy derivatives: what the model leaves of these is noise, or is not."""

import numpy as np
import pytest
from identification_cases import RELEASE, line, solution

from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.recording import Recording

LINE, TIME = line(), np.linspace(0.0, 100.0, 2501)
X = solution(LINE, RELEASE, TIME)


@pytest.mark.parametrize(("lacking", "status"), [(0.0, "ok"), (0.005, "approximate")])
def test_what_the_library_lacks_is_no_noise_of_derivatives(lacking: float, status: str) -> None:
    rates = LINE(X)
    rates[:, 2] += lacking * rates[:, 2].std() * (X[:, 2] / X[:, 2].std()) ** 5
    noise = 0.001 * rates.std(axis=0) * np.random.default_rng(1).standard_normal(rates.shape)
    found = maximum_likelihood(
        Recording(TIME, LINE.states, X, derivatives=rates + noise), LINE.terms
    )
    assert found.status == status, found.reason
    assert ("goes on from sample to sample" in found.reason) == bool(lacking)
    assert np.all(np.isfinite(found.standard_errors[found.support]))
