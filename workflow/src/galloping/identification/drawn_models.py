"""Random models that agree with a recording: from the covariance of a model, and its rivals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.model.intervals import MODEL_DRAWS, draw_normal
from galloping.model.polynomial import PolynomialModel


def draw_models(
    identified: IdentifiedModel, rng: np.random.Generator, count: int = MODEL_DRAWS
) -> list[PolynomialModel]:
    """Draw random models with an identified model's terms, from its coefficient covariance.

    All are equal without a covariance.
    """
    model, support = identified.model, identified.support
    coefficients = np.repeat(model.coefficients[np.newaxis], count, axis=0)
    if len(identified.covariance):
        mean = model.coefficients[support]
        coefficients[:, support] = draw_normal(mean, identified.covariance, count, rng)
    return [replace(model, coefficients=_clip_to_bounds(identified, each)) for each in coefficients]


def _clip_to_bounds(identified: IdentifiedModel, coefficients: np.ndarray) -> np.ndarray:
    """Clip the coefficients of a model to their known bounds, in place, and return them.

    coefficients: (n_states, n_terms).
    """
    for equation, term, least, most in identified.bounds:
        if term in identified.model.terms:
            place = equation, identified.model.terms.index(term)
            coefficients[place] = np.clip(coefficients[place], least, most)
    return coefficients


def draw_models_and_rivals(
    identified: IdentifiedModel, rng: np.random.Generator, count: int = MODEL_DRAWS
) -> list[PolynomialModel]:
    """Draw random models, including rival models with other terms as often as these are probable.

    Draws with the same terms have too narrow a distribution if terms are weak: docs/trust.md.
    Without a covariance, the model alone.
    """
    if not len(identified.covariance):
        return [identified.model]
    models = draw_models(identified, rng, count)
    for k in np.flatnonzero(rng.random(count) < identified.rival_share):
        rival = _clip_to_bounds(identified, np.array(rng.choice(identified.rivals)))
        models[k] = replace(identified.model, coefficients=rival)
    return models


def add_higher_degree_effects(
    models: Sequence[PolynomialModel], identified: IdentifiedModel, rng: np.random.Generator
) -> list[PolynomialModel]:
    """Change randomly drawn models by the possible effect of terms beyond the library's degree.

    models: drawn with `draw_models_and_rivals`. The changes have the mean `extrapolation_shift` and
    the covariance `extrapolation_covariance`. They apply to the terms that a model has, within
    their bounds. Returns the same models where these changes are not stated.
    """
    if not len(identified.extrapolation_shift):
        return list(models)
    mean, covariance = identified.extrapolation_shift, identified.extrapolation_covariance
    changed = []
    for model, change in zip(models, draw_normal(mean, covariance, len(models), rng), strict=True):
        coefficients = model.coefficients.copy()
        coefficients[identified.support] += change * (coefficients[identified.support] != 0.0)
        changed.append(replace(model, coefficients=_clip_to_bounds(identified, coefficients)))
    return changed
