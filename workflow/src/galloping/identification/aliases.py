"""Terms that are equal at all recorded values of the inputs, such as powers of a two-valued input.

A term is a product of powers and functions of states, times a factor, a monomial of the inputs. At
the recorded values some factors are linear combinations of others, exactly: F^2 is 2 F if F was 0
and 2. No recording of these values distinguishes their terms, so only the simplest is a candidate.
At other values the terms differ, which the rivals of the model show.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.drawn_models import draw_models_and_rivals
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.problem import Problem
from galloping.model.intervals import MODEL_DRAWS
from galloping.model.polynomial import Exponents, exponent_matrix, term_name
from galloping.recording.samples import Recording, inputs_at_times

# Largest residual of a factor that is a combination of simpler ones, relative to its length and to
# the root of their number plus one. For factors of unit length, smaller coefficients are rounding.
ROUNDING = 1e-9
MAX_INPUT_VALUES = 4096  # most combinations of recorded input values at which terms are compared


@dataclass(frozen=True)
class Alias:
    """Candidate term that equals a combination of simpler terms at all recorded input values.

    equation: index of the state in whose equation it is. term: its exponents. simpler: coefficients
    of the combination by exponents.
    """

    equation: int
    term: Exponents
    simpler: dict[Exponents, float]


def remove_aliases(problem: Problem, recordings: Sequence[Recording]) -> Problem:
    """Remove candidate terms that equal combinations of simpler terms at all recorded inputs.

    Candidates with bounds are kept. Candidates with a prior are no aliases: the prior determines
    them, and so their sum with others determines these.
    """
    if not problem.inputs:
        return problem
    n, aliases = len(problem.states), []
    powers = exponent_matrix(problem.terms, len(problem.names))[:, n:]
    values = _distinct_input_values(problem, recordings)
    has_bounds = np.zeros_like(problem.open)
    for equation, term, *_ in problem.bounds:
        has_bounds[equation, problem.terms.index(term)] = True
    has_no_prior = problem.open & (problem.precision == 0.0)
    is_open = problem.open.copy()
    for equation in problem.unknown:
        groups: dict[Exponents, list[int]] = {}
        for index in np.flatnonzero(has_no_prior[equation]).tolist():
            term = problem.terms[index]
            of_states = (*term[:n], *term[len(problem.names) :])
            groups.setdefault(of_states, []).append(index)
        for group in groups.values():
            group.sort(key=lambda j: (not has_bounds[equation, j], *_complexity_key(powers[j])))
            for j, combination in _find_combinations(group, powers[group], values):
                if not has_bounds[equation, j]:
                    is_open[equation, j] = False
                    simpler = {problem.terms[k]: c for k, c in combination.items()}
                    aliases.append(Alias(equation, problem.terms[j], simpler))
    return replace(problem, open=is_open, aliases=tuple(aliases))


def _distinct_input_values(problem: Problem, recordings: Sequence[Recording]) -> np.ndarray:
    """List the distinct combinations of recorded values of the inputs, (n, n_inputs)."""
    recorded = []
    for recording in recordings:
        inputs, time = [recording.inputs[name] for name in problem.inputs], recording.time
        moments = np.unique(np.concatenate([time, *(each.time for each in inputs)]))
        moments = moments[(moments >= time[0]) & (moments <= time[-1])]
        recorded.append(inputs_at_times(inputs, moments))
    values = np.concatenate(recorded)
    values = np.unique(values[np.isfinite(values).all(axis=1)], axis=0)
    return values[:: max(-(-len(values) // MAX_INPUT_VALUES), 1)]


def _complexity_key(powers: np.ndarray) -> tuple:
    """Return the sort key of a factor: powers, then inputs, multiplication before division."""
    return np.abs(powers).sum(), np.count_nonzero(powers), (powers < 0).sum(), *powers[::-1]


def _find_combinations(
    places: Sequence[int], factors: np.ndarray, values: np.ndarray
) -> Iterator[tuple[int, dict[int, float]]]:
    """Yield the places of factors that are combinations of earlier ones at all values, with these.

    factors: (n_places, n_inputs) powers. A product with an infinite value, of a division by zero,
    is no combination.
    """
    basis: list[tuple[int, float]] = []
    columns = np.empty((len(values), 0))
    for index, powers in zip(places, factors.astype(float), strict=True):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            column = np.prod(values**powers, axis=1)
        size = float(np.linalg.norm(column))
        if not np.isfinite(size) or size == 0.0:
            continue
        column = column / size
        combination = np.linalg.lstsq(columns, column, rcond=None)[0] if basis else np.empty(0)
        if np.linalg.norm(column - columns @ combination) < ROUNDING * np.sqrt(1 + len(basis)):
            parts = zip(basis, combination, strict=True)
            yield index, {k: float(c * size / unit) for (k, unit), c in parts if abs(c) > ROUNDING}
        else:
            basis.append((index, size))
            columns = np.column_stack([columns, column])


def add_alias_rivals(problem: Problem, identified: IdentifiedModel) -> IdentifiedModel:
    """Add to a model its rivals: other models that are equal at all recorded input values.

    In each rival one alias replaces a term of the model that it contains. All rivals are as
    probable as the model itself, so that intervals at values that were not recorded are valid.
    """
    model = identified.model
    if not problem.aliases or identified.status == "refused" or not len(identified.covariance):
        return identified
    index = {term: j for j, term in enumerate(model.terms)}
    exchanges = [
        (alias, term)
        for alias in problem.aliases
        for term in alias.simpler
        if identified.support[alias.equation, index[term]]
    ]
    if not exchanges:
        return identified
    rng = np.random.default_rng(0)
    drawn, rivals = draw_models_and_rivals(identified, rng), []
    for k in range(max(MODEL_DRAWS, len(exchanges))):
        alias, term = exchanges[k % len(exchanges)]
        coefficients = drawn[k % len(drawn)].coefficients.copy()
        row = coefficients[alias.equation]
        share = row[index[term]] / alias.simpler[term]
        for other, coefficient in alias.simpler.items():
            row[index[other]] -= share * coefficient
        row[index[term]] = 0.0
        row[index[alias.term]] += share
        rivals.append(coefficients)
    others = len(exchanges)  # alternatives, each as probable as the model itself
    share = (others + identified.rival_share) / (others + 1.0)
    copies = round(len(rivals) * identified.rival_share / others)
    rivals += [identified.rivals[k % len(identified.rivals)] for k in range(copies)]
    parts = dict.fromkeys(
        f"{term_name(alias.term, model.names)} from {term_name(term, model.names)} in "
        f"d({problem.states[alias.equation]})/dt"
        for alias, term in exchanges
    )
    terms = ", ".join(list(parts)[:4])
    finding = Finding.of(Code.ALIASED_TERMS, ", ".join(problem.inputs), terms=terms)
    with_rivals = replace(identified, rivals=np.array(rivals), rival_share=share)
    return with_rivals.with_findings(finding)
