"""Identification by the weak form alone, a fast method; `maximum_likelihood` starts from it."""

from collections.abc import Sequence

import numpy as np

from galloping.arrays import one_thread
from galloping.identification.aliases import add_alias_rivals
from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import (
    checked_recordings,
    segments_with_inputs,
    validated_problem,
)
from galloping.identification.likelihood.repetition import FollowedRecording
from galloping.identification.likelihood.verdict import Regression, assess_fit
from galloping.identification.no_model import IdentificationError, NoModel, attempt
from galloping.identification.postprocessing import add_input_errors, refused_model
from galloping.identification.preparation.weak_form import MAX_WEAK_MISFIT, Start, make_start
from galloping.model.polynomial import Exponents, PolynomialModel
from galloping.recording.samples import Recording


@one_thread
def weak_gls(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    start: Start | None = None,
) -> IdentifiedModel:
    """Identify the equations of a system by generalised least squares on their weak form.

    The states are measured with noise. The method is faster and less accurate than
    `maximum_likelihood`.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Recordings of one system, at any times; NaN marks missing samples.
    terms : tuple of Exponents
        The candidate terms.
    known : PolynomialModel, optional
        Model whose equations of `known_states` are known. The equation dX/dt = dX is always known
        if X and dX are states.
    known_states : tuple of str
        States whose equations are known.
    start : Start, optional
        The result of `make_start`, if it exists already.

    Returns
    -------
    IdentifiedModel
        Its intervals are those of the linearised weak form, widened if the misfit is above one.

    Raises
    ------
    ValueError
        If an argument has another form.
    """
    recordings = checked_recordings(recordings)
    problem = validated_problem(recordings, terms, known, known_states)

    def search_model() -> IdentifiedModel:
        segments = segments_with_inputs(recordings, problem.inputs)
        guess = start or make_start(problem, segments)
        fit, inflation = guess.fit, max(guess.fit.misfit, 1.0)
        if fit.misfit >= MAX_WEAK_MISFIT:
            raise IdentificationError(Code.WEAK_MISFIT, misfit=fit.misfit)
        system = fit.information / inflation, fit.right / inflation
        identified = assess_fit(
            problem,
            Regression(*system, fit.support, guess.penalty, guess.largest),
            followed=[
                FollowedRecording(np.zeros(1), one.states[:1], np.ptp(recording.time))
                for one, recording in zip(guess.smoothed, guess.recordings, strict=True)
            ],
            period=guess.period,
            initial_states=np.array([one.states[0] for one in guess.smoothed]),
            sigma=np.array([one.noise for one in guess.smoothed]),
            chi2=fit.misfit,
        )
        return add_alias_rivals(problem, add_input_errors(identified, recordings, segments))

    outcome = attempt(search_model)
    return refused_model(problem, outcome.findings) if isinstance(outcome, NoModel) else outcome
