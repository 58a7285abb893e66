"""Checks of the arguments of an identification, with one line for each error."""

from collections.abc import Sequence
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from galloping.identification.aliases import remove_aliases
from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.prior_knowledge import Coefficient, Prior
from galloping.identification.problem import Problem, make_problem
from galloping.model.functions import Function, n_exponents
from galloping.model.polynomial import Exponents, PolynomialModel
from galloping.recording.samples import Recording
from galloping.recording.shared_rows import find_shared_rows

MAX_CANDIDATES = 600  # most terms of all equations: exchanges of three then fit in memory
MIN_SAMPLES = 100  # least number of samples: with fewer, noise may look like an oscillation
# Largest mean time between samples, relative to the median. Beyond it a recording is mostly gaps,
# and the uniform grids of times that the methods use would not fit in memory.
MAX_MEAN_STEP = 200


def checked_recordings(recordings: object) -> list[Recording]:
    """Check one recording or several, and return them as a list.

    Raises ValueError if there are none, or if they are not recordings, differ in their states,
    are too short, consist mostly of gaps, or share samples, which would count twice.
    """
    requirement = "must be a Recording, or a list of recordings of one system"
    if isinstance(recordings, Recording):
        recordings = [recordings]
    if not isinstance(recordings, list | tuple):
        kind = type(recordings).__name__
        raise ValueError(
            f"recordings: a {kind}; {requirement} (Recording.from_frame takes a DataFrame)"
        )
    if not recordings:
        raise ValueError(f"recordings: is empty; {requirement}")
    for i, recording in enumerate(recordings):
        if not isinstance(recording, Recording):
            raise ValueError(f"recordings: item {i} is a {type(recording).__name__}; {requirement}")
        if recording.states != recordings[0].states:
            raise ValueError(
                f"recordings: item {i} has the states {', '.join(recording.states)}; "
                f"must have those of the first, {', '.join(recordings[0].states)}"
            )
        if lacking := set(recordings[0].inputs) - set(recording.inputs):
            raise ValueError(
                f"recordings: item {i} lacks the input {', '.join(sorted(lacking))} of the first"
            )
        steps = np.diff(recording.time)
        if len(steps) and np.mean(steps) > MAX_MEAN_STEP * np.median(steps):
            raise ValueError(
                f"recordings: item {i} has a gap of {steps.max():.4g} s between samples "
                f"{np.median(steps):.4g} s apart; must be two recordings, before and after it"
            )
    if (samples := sum(len(recording.time) for recording in recordings)) < MIN_SAMPLES:
        raise ValueError(f"recordings: {samples} samples are fewer than the {MIN_SAMPLES} needed")
    channels = ((one.values, one.rates) for one in recordings)
    whole = [x if dx is None else np.hstack([x, dx]) for x, dx in channels]
    if shared := find_shared_rows(whole):
        first, second, row = shared
        raise ValueError(
            f"recordings: item {second} repeats samples of item {first} from its sample {row} on; "
            "must contain each sample once"
        )
    return list(recordings)


def validated_problem(
    recordings: list[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = None,
    coefficients: Sequence[Coefficient] = (),
    allowed: ArrayLike | None = None,
) -> Problem:
    """Check the arguments of an identification and return the identification problem.

    Terms that are aliases at the inputs of the recordings are no candidates. Raises ValueError if
    the library or the known equations do not fit the states and inputs, if `prior` is no `Prior`,
    and as `make_problem` does.
    """
    states, inputs = recordings[0].states, tuple(recordings[0].inputs)
    n = len(states)
    hint = f"must be tuples of {n} exponents, such as polynomial_library({n}, degree)"
    if inputs:
        hint += f"; or of {n + len(inputs)}, of the states and of {', '.join(inputs)}"
    if not isinstance(terms, list | tuple) or not terms:
        raise ValueError(f"terms: {terms!r:.60}; {hint}")
    for term in terms:
        exponents = term[: n_exponents(term)] if isinstance(term, tuple) else ()
        is_valid = (
            len(exponents) in (n, n + len(inputs))
            and len(exponents) == n_exponents(terms[0])
            and all(isinstance(e, Integral) for e in exponents)
            and all(isinstance(f, Function) and len(f.weights) == n for f in term[len(exponents) :])
        )
        if not is_valid or not all(e >= 0 for e in exponents[:n]):
            raise ValueError(f"terms: {term!r:.60}; {hint}")
        for name, exponent in zip(inputs, exponents[n:], strict=False):
            if exponent < 0 and any(one.inputs[name].has_zero(one.time) for one in recordings):
                raise ValueError(f"terms: {term!r:.60}; {name} is 0 in a recording")
    for name, value, kind in (("known", known, PolynomialModel), ("prior", prior, Prior)):
        if value is not None and not isinstance(value, kind):
            wanted = f"must be a {kind.__name__} or None"
            raise ValueError(f"{name}: a {type(value).__name__}; {wanted}")
    if known is not None and known.states != states:
        raise ValueError(f"known: has the states {known.states}; must have {states}")
    for name in known_states:
        if name not in states:
            raise ValueError(f"known_states: {name!r}; must be among {', '.join(states)}")
    if not isinstance(coefficients, list | tuple) or not all(
        isinstance(one, Coefficient) for one in coefficients
    ):
        raise ValueError(f"coefficients: {coefficients!r:.60}; must be a list of Coefficient")
    if allowed is not None and np.shape(allowed) != (n, len(terms)):
        raise ValueError(f"allowed: has shape {np.shape(allowed)}; must have ({n}, {len(terms)})")
    if known_states and known is None:
        raise ValueError(f"known_states: {', '.join(known_states)}; needs `known`, their equations")
    problem = make_problem(states, terms, known, known_states, prior, inputs, coefficients, allowed)
    if (count := len(problem.candidates)) > MAX_CANDIDATES:
        raise ValueError(
            f"library: {len(terms)} terms in {len(problem.unknown)} equations are {count} "
            f"candidates; at most {MAX_CANDIDATES} can be compared"
        )
    return remove_aliases(problem, recordings)


def segments_with_inputs(recordings: list[Recording], inputs: tuple[str, ...]) -> list[Recording]:
    """Cut recordings into the stretches in which all given inputs have samples.

    The stretches are those of `Recording.driven`. Raises IdentificationError if the inputs are
    present during fewer than MIN_SAMPLES consecutive samples.
    """
    stretches = [stretch for one in recordings for stretch in one.driven(inputs, MIN_SAMPLES)]
    if not stretches:
        raise IdentificationError(Code.INPUTS_MISSING, ", ".join(inputs), samples=MIN_SAMPLES)
    return stretches
