"""The model of the weak form, from which the other methods only start: a fast method of its own, by
a name of its own in the register of methods, and so a module.
"""

from collections.abc import Sequence

import numpy as np

from galloping.arrays import one_thread
from galloping.identification.aliases import with_alias_rivals
from galloping.identification.answers import refused, with_inputs
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import asked, checked_recordings, while_driven
from galloping.identification.likelihood.repetition import Followed
from galloping.identification.likelihood.verdict import Regression, judged
from galloping.identification.no_model import NoModel, Unusable, attempt
from galloping.identification.observations import Code
from galloping.identification.preparation.weak_form import MOST_MISFIT, Start, begin
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
    """Identify one model from noisy states by the weak form, in generalised least squares.

    recordings: of one system, any sampling, NaN where missing. terms: the library. known: model
    whose equations of `known_states` hold; the equation of a state X is known to be dX/dt = dX
    where a state has that name. start: of `begin`, where it is made already.
    The intervals are those of the linearised weak form, inflated by the misfit where it is above
    one. The status is as in `IdentifiedModel`. Raises ValueError for other input.
    """
    recordings = checked_recordings(recordings)
    problem = asked(recordings, terms, known, known_states)

    def search() -> IdentifiedModel:
        used = while_driven(recordings, problem.inputs)
        begun = start or begin(problem, used)
        fit, more = begun.fit, max(begun.fit.misfit, 1.0)
        if fit.misfit >= MOST_MISFIT:
            raise Unusable(Code.WEAK_MISFIT, misfit=fit.misfit)
        system = fit.information / more, fit.right / more
        found = judged(
            problem,
            Regression(*system, fit.support, begun.penalty, begun.largest),
            followed=[
                Followed(np.zeros(1), one.states[:1], np.ptp(recording.time))
                for one, recording in zip(begun.smoothed, begun.recordings, strict=True)
            ],
            period=begun.period,
            initial_states=np.array([one.states[0] for one in begun.smoothed]),
            sigma=np.array([one.noise for one in begun.smoothed]),
            chi2=fit.misfit,
        )
        return with_alias_rivals(problem, with_inputs(found, recordings, used))

    found = attempt(search)
    return refused(problem, found.findings) if isinstance(found, NoModel) else found
