"""Methods of this package as a study calls them, with their common starting point."""

from collections.abc import Sequence

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import segments_with_inputs, validated_problem
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.preparation.weak_form import make_start
from galloping.model.polynomial import Exponents
from galloping.recording.samples import Recording


def shared_evidence(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> dict:
    """Prepare recordings, terms and initial guess for `weak_gls` and `maximum_likelihood`.

    Returns them by argument name. `start` is None if there is none, for a reason that each method
    finds again, or if the states are exact and need none.
    """
    recordings, start = list(recordings), None
    if not all(recording.exact for recording in recordings):
        problem = validated_problem(recordings, terms)
        outcome = attempt(
            lambda: make_start(problem, segments_with_inputs(recordings, problem.inputs))
        )
        start = None if isinstance(outcome, NoModel) else outcome
    return {"recordings": recordings, "terms": terms, "start": start}


def run_weak_gls(evidence: dict) -> IdentifiedModel:
    """Identify a model from the prepared data of a study by the weak form, `weak_gls`."""
    return weak_gls(**evidence)


def run_maximum_likelihood(evidence: dict) -> IdentifiedModel:
    """Identify a model from the prepared data of a study by `maximum_likelihood`."""
    return maximum_likelihood(**evidence)
