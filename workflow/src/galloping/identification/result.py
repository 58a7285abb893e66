"""What every identification method returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from galloping.polynomial import PolynomialModel


@dataclass(frozen=True)
class Identified:
    """A model from recordings, with its uncertainty and a verdict.

    model: on the full library, zero where a term is absent; known equations included.
    support: (n_states, n_terms) boolean, the terms found in the unknown equations.
    covariance: (n_found, n_found) of their coefficients, in the order of np.argwhere(support).
    initial_states: (n_recordings, n_states), at the first sample of each recording.
    sigma: (n_recordings, n_states) noise of a sample of each channel, NaN where not measured; for
    recordings with derivatives, noise of the derivatives.
    chi2: misfit per degree of freedom against the noise measured within short windows.
    status: `ok`; `not identifiable` when the data leave open which terms there are, the model
    being one of those possible; `refused` when it must not be trusted. reason: one line, or ''.
    deviation: (n_states, n_terms) standard deviation of each coefficient: of the found ones as in
    `covariance`, of each absent one were it added; NaN in known equations.
    diagnostics: figures behind the verdict, by name.
    """

    model: PolynomialModel
    support: np.ndarray
    covariance: np.ndarray
    initial_states: np.ndarray
    sigma: np.ndarray
    chi2: float
    status: str
    reason: str
    deviation: np.ndarray
    diagnostics: dict[str, float] = field(default_factory=dict)
