"""What a user hands to an identification, or one line that says what is wrong with it."""

from __future__ import annotations

from numbers import Integral

from galloping.identification.likelihood.prior import Prior
from galloping.polynomial import Exponents, PolynomialModel
from galloping.recording import Recording

FEWEST = 100  # samples: fewer hold no oscillation that could be told from noise


WANTED = "must be a Recording, or a list of recordings of one system"


def checked_recordings(recordings: object) -> list[Recording]:
    """One recording or several as a list.

    Raises ValueError where they are none, not recordings, differ in their states, or are too short.
    """
    if isinstance(recordings, Recording):
        recordings = [recordings]
    if not isinstance(recordings, list | tuple):
        what = type(recordings).__name__
        raise ValueError(f"recordings: a {what}; {WANTED} (Recording.from_frame takes a DataFrame)")
    if not recordings:
        raise ValueError(f"recordings: is empty; {WANTED}")
    for i, recording in enumerate(recordings):
        if not isinstance(recording, Recording):
            raise ValueError(f"recordings: item {i} is a {type(recording).__name__}; {WANTED}")
        if recording.states != recordings[0].states:
            raise ValueError(
                f"recordings: item {i} has the states {', '.join(recording.states)}; "
                f"must have those of the first, {', '.join(recordings[0].states)}"
            )
    if (samples := sum(len(recording.time) for recording in recordings)) < FEWEST:
        raise ValueError(f"recordings: {samples} samples are fewer than the {FEWEST} needed")
    return list(recordings)


def check_question(
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None,
    known_states: tuple[str, ...],
    prior: Prior | None = None,
) -> None:
    """Raise ValueError where the library or the known equations are not about `states`, or the
    prior is none.
    """
    n = len(states)
    hint = f"must be tuples of {n} exponents, such as polynomial_library({n}, degree)"
    if not isinstance(terms, list | tuple) or not terms:
        raise ValueError(f"terms: {terms!r:.60}; {hint}")
    for term in terms:
        sound = isinstance(term, tuple) and len(term) == n
        if not sound or not all(isinstance(e, Integral) and e >= 0 for e in term):
            raise ValueError(f"terms: {term!r:.60}; {hint}")
    if known is not None and not isinstance(known, PolynomialModel):
        raise ValueError(f"known: a {type(known).__name__}; must be a PolynomialModel or None")
    if prior is not None and not isinstance(prior, Prior):
        raise ValueError(f"prior: a {type(prior).__name__}; must be a Prior or None")
    if known is not None and known.states != states:
        raise ValueError(f"known: has the states {known.states}; must have {states}")
    for name in known_states:
        if name not in states:
            raise ValueError(f"known_states: {name!r}; must be among {', '.join(states)}")
    if known_states and known is None:
        raise ValueError(f"known_states: {', '.join(known_states)}; needs `known`, their equations")
