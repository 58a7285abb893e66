"""A fast method of its own: the model of the weak form, from which others only start."""

from collections.abc import Sequence

import numpy as np

from galloping.arrays import one_thread
from galloping.identification.answers import refused, with_inputs
from galloping.identification.inputs import asked, checked_recordings, driven
from galloping.identification.likelihood.verdict import Regression, judged
from galloping.identification.model import NO_MODEL, IdentifiedModel, Unusable
from galloping.identification.preparation.weak_form import MOST_MISFIT, Start, begin
from galloping.polynomial import Exponents, PolynomialModel
from galloping.recording import Recording


@one_thread
def weak_gls(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    start: Start | None = None,
) -> IdentifiedModel:
    """Identify one model from noisy states by the weak form, in generalised least squares.

    recordings: of one system, any sampling, NaN where missing. terms: the library. known: model
    whose equations of `known_states` hold; dX/dt = `dX` is known by its name. start: of
    `begin`, where it is made already.
    The intervals are those of the linearised weak form, inflated by the misfit where it is above
    one. The status is as in `IdentifiedModel`. Raises ValueError for other input.
    """
    recordings = checked_recordings(recordings)
    problem = asked(recordings, terms, known, known_states)
    try:
        used = driven(recordings, problem.inputs)
        start = start or begin(problem, used)
        fit, more = start.fit, max(start.fit.misfit, 1.0)
        if fit.misfit >= MOST_MISFIT:
            raise Unusable(f"model inadequate or noise correlated: misfit {fit.misfit:.2f}")
        system = fit.information / more, fit.right / more
        found = judged(
            problem,
            Regression(*system, fit.support, start.penalty, start.largest),
            recordings=start.recordings,
            period=start.period,
            initial_states=np.array([one.states[0] for one in start.smoothed]),
            sigma=np.array([one.noise for one in start.smoothed]),
            chi2=fit.misfit,
        )
        return with_inputs(found, recordings, used)
    except NO_MODEL as error:
        return refused(problem, str(error))
