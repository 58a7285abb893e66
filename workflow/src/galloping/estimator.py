"""Maximum likelihood as an estimator in the style of pysindy and scikit-learn."""

import warnings
from collections.abc import Mapping, Sequence
from inspect import signature
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import as_increasing
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.prior_knowledge import PRIOR, Coefficient, Prior, as_coefficients
from galloping.model.polynomial import Exponents, polynomial_library
from galloping.model.terms import known_model, parse_library
from galloping.recording.containers import (
    Data,
    Driving,
    SampleTimes,
    Table,
    is_several,
    make_inputs,
    make_recordings,
    split_samples,
)
from galloping.recording.samples import Recording
from galloping.summary.summarise import score_motion

if TYPE_CHECKING:
    from pandas import DataFrame
    from sklearn.utils import Tags

Library: TypeAlias = str | Sequence[str] | Sequence[Exponents] | None
DEFAULT_DEGREE = 3  # degree of the default library: friction, drag and stiffness have cubic terms
# Largest number of states and inputs for this degree: a recording of some periods does not
# distinguish the cubic terms of more of them.
MAX_CUBIC_NAMES = 4
REDUCED_DEGREE = 2  # degree of the default library of more states and inputs


class NotFittedError(ValueError, AttributeError):
    """Error raised if a method that needs a fitted estimator is called before `fit`."""


class MaximumLikelihood:
    """Estimator of the differential equations of a system from recordings of its states.

    The model is dx/dt = C theta(x, u) with states x, inputs u and candidate terms theta. The method
    is `maximum_likelihood`, which fits trajectories to the samples and computes no derivatives.

    Parameters
    ----------
    library : str, sequence of str, or sequence of terms, optional
        Candidate terms: in the grammar of `galloping.library`, such as
        `"poly(q, dq; 3) + sin(q) + |dq| dq"`, or exponents as `polynomial_library` returns. By
        default all monomials of the states and inputs up to `degree`.
    degree : int, optional
        Of the default library: 3 for up to four states and inputs together, 2 for more.
    feature_names : sequence of str, optional
        Names of the states: by default those of the columns, else x0, x1, ... The equation
        dX/dt = dX is known if X and dX are states.
    input_names : sequence of str, optional
        Names of the inputs: by default those of the columns, else u0, u1, ...
    known : str, or sequence of str or Coefficient
        Prior knowledge, in the grammar of `galloping.library`: an equation, `"q = dq"`, a
        coefficient, `"dq: q = -4 +- 0.1"`, or its bounds, `"dq: dq < 0"`.
    prior : Prior, optional
        Prior odds of terms; None replaces them by a penalty of 2 ln N for N samples.
    between : {"cubic", "linear", "zero"}
        Inputs between their samples: smooth, linear, or held.
    forced : sequence of str, optional
        Coordinates that unmeasured random forces move; () for all. By default random forces are
        tried if they could have caused the motion.

    Attributes
    ----------
    model_ : IdentifiedModel
        The model with its covariance and status, an argument for `summarise`, `forecast`, `assess`.
    recordings_ : list of Recording
        The recordings that the model was fitted to.
    coef_ : (n_states, n_terms) array
        Coefficients; zero for absent terms, NaN if there is no model.
    feature_names_in_, input_names_in_ : (n_states,) and (n_inputs,) arrays of str
        Names of the states and inputs.
    n_features_in_ : int
        Number of states.

    Examples
    --------
    >>> import numpy as np
    >>> import galloping
    >>> oscillator = galloping.parse_model("q = dq; dq = -4 q - 0.2 dq - q^3")
    >>> t = np.arange(1000) / 50
    >>> x = galloping.simulate(oscillator, [2, 0], t).states
    >>> x = x + np.random.default_rng(1).normal(0, 0.02, x.shape)
    >>> model = galloping.MaximumLikelihood(feature_names=["q", "dq"]).fit(x, t)
    >>> model.coefficients().index.to_list()
    [('q', 'dq'), ('dq', 'q'), ('dq', 'dq'), ('dq', 'q^3')]
    >>> model.simulate([1, 0], t).shape
    (1000, 2)
    """

    model_: IdentifiedModel
    recordings_: list[Recording]
    coef_: NDArray[np.float64]
    feature_names_in_: NDArray[np.object_]
    input_names_in_: NDArray[np.object_]
    n_features_in_: int

    def __init__(
        self,
        library: Library = None,
        *,
        degree: int | None = None,
        feature_names: Sequence[str] | None = None,
        input_names: Sequence[str] | None = None,
        known: str | Sequence[str | Coefficient] = (),
        prior: Prior | None = PRIOR,
        between: str = "cubic",
        forced: Sequence[str] | None = None,
    ) -> None:
        self.library = library
        self.degree = degree
        self.feature_names = feature_names
        self.input_names = input_names
        self.known = known
        self.prior = prior
        self.between = between
        self.forced = forced

    def fit(
        self, x: Data, t: SampleTimes = None, u: Driving = None, *, x_dot: Data | None = None
    ) -> "MaximumLikelihood":
        """Fit the model to one or several recordings of one system.

        Parameters
        ----------
        x : (n, n_states) array, frame, `Recording`, or a list of these
            States; NaN marks missing samples. Frames of pandas, polars and xarray, and mappings of
            columns are accepted. Each item of a list is one recording.
        t : float, (n,) array, str, or a list of these, optional
            Step or times of the samples, s, or the name of the column with the times. By default
            the times are the column `t` of a frame, or its index. Dates are accepted.
        u : (n,) or (n, n_inputs) array, frame, mapping, names of columns of `x`, or a list
            Inputs at the times of the samples. A mapping may contain an `Input` with its own times.
        x_dot : (n, n_states) array, frame, or a list of these, optional
            Measured rates of the states, as of accelerometers.

        Returns
        -------
        MaximumLikelihood
            The estimator. If the recordings give no model, the status of `model_` is `refused`, and
            its reason says why. This is not an error.

        Raises
        ------
        ValueError
            If data or options do not match, in one line.
        """
        names = None if self.input_names is None else tuple(self.input_names) or None
        recordings = make_recordings(
            x, t, u, x_dot, states=self.feature_names, inputs=names, between=self.between,
        )  # fmt: skip
        states, inputs = recordings[0].states, tuple(recordings[0].inputs)
        terms, allowed = self._terms(states, inputs)
        knowledge = [self.known] if isinstance(self.known, str) else list(self.known)
        texts = [each for each in knowledge if isinstance(each, str)]
        known, known_states, single = known_model(texts, states, terms, inputs)
        coefficients = [each for each in knowledge if not isinstance(each, str)]
        coefficients += [one for each in single for one in as_coefficients(each)]
        self.model_ = maximum_likelihood(
            recordings, terms, known, known_states, self.prior, forced=self.forced,
            coefficients=coefficients, allowed=allowed,
        )  # fmt: skip
        self.recordings_ = recordings
        self.coef_ = self.model_.model.coefficients
        self.feature_names_in_ = np.array(states, dtype=object)
        self.input_names_in_ = np.array(self.model_.model.inputs, dtype=object)
        self.n_features_in_ = len(states)
        return self

    def predict(self, x: Any, u: Driving = None) -> Any:
        """Compute the time derivatives of the states, by the fitted model, at given states.

        Parameters
        ----------
        x : (n, n_states) array or frame, or a list of these
        u : (n,) or (n, n_inputs) array or frame, or a list of these
            Inputs of the model.

        Returns
        -------
        (n, n_states) array, or a list of these
        """
        model = self._fitted().model
        if is_several(x):
            each_u: Any = u if isinstance(u, list | tuple) else [u] * len(x)
            if len(each_u) != len(x):
                raise ValueError(f"u: must be a list of {len(x)}, one for each recording of x")
            return [self.predict(*each) for each in zip(x, each_u, strict=True)]
        if isinstance(x, Recording):
            self._check_inputs(x)
            u = {name: x.inputs[name](x.time) for name in model.inputs} or None
            x = x.values
        _, _, values, driving = split_samples(x, None, u, model.states)
        self._check_inputs(driving)
        input_values = (
            Table.from_data("u", driving).matrix(model.inputs)[1] if model.inputs else None
        )
        if input_values is not None and len(input_values) != len(values):
            raise ValueError(f"u: has {len(input_values)} samples; x has {len(values)}")
        return model(values, input_values)

    def simulate(self, x0: ArrayLike, t: ArrayLike, u: Driving = None) -> NDArray[np.float64]:
        """Integrate the fitted model in time from an initial state.

        Parameters
        ----------
        x0 : (n_states,) array
            State at t[0].
        t : (n,) array
            Increasing times, s.
        u : (n,) or (n, n_inputs) array, frame, mapping, or callable
            Inputs at the times `t`. A mapping of names may have an `Input` or a constant.

        Returns
        -------
        (n, n_states) array
            NaN after the motion diverges, with a RuntimeWarning. `model_.simulate` returns a
            `Trajectory`.
        """
        identified, time = self._fitted(), as_increasing("t", t)
        self._check_inputs(u)
        inputs = identified.model.inputs
        driving = None if u is None else make_inputs(u, time, inputs, self.between)
        motion = identified.simulate(x0, time, driving)
        if motion.status != "ok":
            warnings.warn(motion.status, RuntimeWarning, stacklevel=2)
        return motion.states

    def score(
        self, x: Data, t: SampleTimes = None, u: Driving = None, *, x_dot: Data | None = None
    ) -> float:
        """Compute R2 of the simulated states, or of predicted derivatives if `x_dot` is given.

        The recording is cut into stretches of six periods. In each stretch, the model starts from
        the state that fits the samples best. The samples are not differentiated.

        Parameters
        ----------
        x, t, u, x_dot : as of `fit`

        Returns
        -------
        float
            Mean R2 of the states or of their rates: 1 for a perfect fit, 0 if it is no better than
            the mean of the samples. A stretch in which the model diverges counts as its mean.
        """
        identified = self._fitted()
        recordings = make_recordings(
            x, t, u, x_dot, states=identified.model.states, inputs=identified.model.inputs or None,
            between=self.between,
        )  # fmt: skip
        for one in recordings:
            self._check_inputs(one)
        if x_dot is None:
            return float(np.mean(score_motion(identified, recordings)))
        rates = np.concatenate([one.rates for one in recordings if one.rates is not None])
        error = rates - np.concatenate([self.predict(one) for one in recordings])
        return float(np.nanmean(1.0 - np.nanmean(error**2, axis=0) / np.nanvar(rates, axis=0)))

    def equations(self) -> list[str]:
        """Return each state's equation as text, with standard errors of the coefficients."""
        return list(self._fitted().equations())

    def coefficients(self, absent: bool = False) -> "DataFrame":
        """Return a DataFrame of the coefficients with their standard errors.

        absent: whether absent terms have rows too. See `IdentifiedModel.to_frame`.
        """
        return self._fitted(allow_refused=True).to_frame(absent)

    def print(self, **options: Any) -> None:
        """Print the equations and the status of the fitted model.

        options: of the built-in function `print`.
        """
        print(self._fitted(allow_refused=True), **options)

    def get_feature_names(self) -> list[str]:
        """Return the names of the candidate terms, in the order of the columns of `coef_`."""
        return list(self._fitted(allow_refused=True).model.term_names)

    # --- what scikit-learn expects of an estimator ---

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor options by name; `deep` has no effect, as none is an estimator."""
        return {name: getattr(self, name) for name in signature(type(self)).parameters}

    def set_params(self, **options: Any) -> "MaximumLikelihood":
        """Set constructor options by name; raise ValueError for an unknown name."""
        names = list(signature(type(self)).parameters)
        for name, value in options.items():
            if name not in names:
                raise ValueError(f"{name}: no option; must be one of {', '.join(names)}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> "Tags":
        from sklearn.utils import Tags, TargetTags  # an extra, which the method does not need

        return Tags(estimator_type=None, target_tags=TargetTags(required=False))

    def __repr__(self) -> str:
        usual = signature(type(self)).parameters
        non_defaults = {
            n: v for n, v in self.get_params().items() if repr(v) != repr(usual[n].default)
        }
        options = ", ".join(f"{name}={value!r}" for name, value in non_defaults.items())
        return f"{type(self).__name__}({options})"

    def _repr_latex_(self) -> str | None:
        """Format the fitted model for notebooks."""
        return self.model_._repr_latex_() if hasattr(self, "model_") else None

    # --- parts ---

    def _fitted(self, allow_refused: bool = False) -> IdentifiedModel:
        """Return the fitted model; raise NotFittedError before `fit`, ValueError if refused."""
        if not hasattr(self, "model_"):
            raise NotFittedError(f"this {type(self).__name__} is not fitted yet: call fit first")
        if self.model_.status == "refused" and not allow_refused:
            raise ValueError(f"there is no model: {self.model_.reason}")
        return self.model_

    def _terms(
        self, states: tuple[str, ...], inputs: tuple[str, ...]
    ) -> tuple[tuple[Exponents, ...], NDArray[np.bool_] | None]:
        """Return the terms of the library, and the equations in which each may be."""
        count = len(states) + len(inputs)
        if self.library is None:
            usual = DEFAULT_DEGREE if count <= MAX_CUBIC_NAMES else REDUCED_DEGREE
            return polynomial_library(count, usual if self.degree is None else self.degree), None
        if self.degree is not None:
            raise ValueError(f"degree: {self.degree!r:.60}; must be None beside a library")
        if isinstance(self.library, str) or all(isinstance(each, str) for each in self.library):
            return parse_library(self.library, states, inputs)  # type: ignore[arg-type]
        return tuple(tuple(term) for term in self.library), None

    def _check_inputs(self, u: object) -> None:
        """Raise ValueError unless `u` has the inputs of the model; a Recording may have others."""
        inputs = self.model_.model.inputs
        data = u.inputs if isinstance(u, Recording) else u
        lacking = inputs if data is None else ()
        if isinstance(data, Mapping):
            lacking = tuple(name for name in inputs if name not in data)
        if lacking:
            has = f"the model has the inputs {', '.join(inputs)}"
            raise ValueError(f"u: {', '.join(lacking)} is missing; {has}")
        if data is not None and not inputs and not isinstance(u, Recording):
            raise ValueError("u: must be left out; the model has no inputs")
