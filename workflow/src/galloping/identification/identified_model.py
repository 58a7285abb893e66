"""Result of every identification method: a model, its uncertainty, and the reasons."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import Immutable, as_increasing, checked_state
from galloping.identification.findings import Code, Finding, status_of
from galloping.identification.oscillations import EnvelopePart, FurtherMode, Resonance
from galloping.identification.sentences import join_words, reason_of
from galloping.model.functions import from_plain, n_exponents, term_to_plain
from galloping.model.intervals import NORMAL_95
from galloping.model.polynomial import Bound, Exponents, PolynomialModel, merge_inputs
from galloping.recording.samples import Input
from galloping.storage import read_json, write_json

if TYPE_CHECKING:
    from pandas import DataFrame

    from galloping.trajectory.simulation import Trajectory


# Suffixes of the names of recorded ranges of inputs and states in diagnostics.
RANGE_SUFFIXES = ("_low", "_high")
# Least R2 of useful forecasts over some periods: at this limit they miss 45 % of the motion. Below,
# the recorded motion may be due to random forces. With 0.7 and with 0.9 no answer of `make exam`
# changes.
MIN_FORECAST_R2 = 0.8
MAX_NAME_LENGTH = 100  # most characters in the name of a state or an input in a file
MAX_COEFFICIENT = 1e100  # coefficients of a file are smaller: products of two are finite
MAX_EXPONENT = 64  # largest absolute value of an exponent in a term of a file
NO_ARRAY: Any = None  # default of an array: becomes NaN, zero for forces, or empty
# Fields with one value for each equation and term.
TERM_FIELDS = ("standard_errors", "unconditional_errors", "detection_limits")


@dataclass(frozen=True, eq=False, repr=False)
class IdentifiedModel(Immutable):
    """Model identified from recordings, with its uncertainty and a status such as `ok`.

    Arrays are read-only, and NaN if the method does not state them. Models with equal contents are
    equal, and have the same hash.

    Parameters
    ----------
    model : PolynomialModel
        On the candidate library, known equations included: zero where a term is absent, NaN if
        there is no model.
    findings : tuple of Finding
        What was noticed.
    is_judged : bool
        Whether the model was assessed, so that its status follows from the findings.
    standard_errors : (n_states, n_terms) array
        Of present terms, if the terms are right.
    unconditional_errors : (n_states, n_terms) array
        Of present and absent terms, rival models included.
    detection_limits : (n_states, n_terms) array
        Sizes from which absent terms would have been selected.
    covariance : (n_support, n_support) array
        Of the present terms, in the order of np.argwhere(support); (0, 0) if not stated.
    rivals : (n_rivals, n_states, n_terms) array
        Coefficients drawn from plausible models with other terms, by their probability, known
        equations included.
    rival_share : float
        Probability of these models together, zero if the method does not compute it.
    extrapolation_shift, extrapolation_covariance : (n_support,) and (n_support, n_support) arrays
        Mean and covariance of the change of the coefficients by terms of the next degrees, for
        motions smaller than all recorded ones. In the order of `covariance`; empty if not stated.
    initial_states : (n_recordings, n_states) array
        At the first sample of each recording.
    sigma : (n_recordings, n_states) array
        Noise of a sample of each channel, NaN if not measured; for exact states, noise of the
        derivatives.
    thresholds : (n_states,) array
        Threshold of each equation, in the method's unit, NaN without one.
    chi2 : float
        Misfit per degree of freedom, relative to the measured noise, NaN if unknown.
    known : tuple of int
        Indices of the known equations.
    diagnostics : mapping of str to float or str
        Numbers behind the status, and `path`, the stages that led to the model, in order.
    further_modes : tuple of FurtherMode
        Modes of the recordings for which the model has no coordinate.
    envelope : tuple of EnvelopePart
        Frequency and damping for each amplitude, of a free motion that is not exponential.
    forces : (n_states, n_states) array
        Covariance per second of white forces, dx = f(x) dt + dW; zero without random forces.
    slow_forces : (n_states, n_states) array
        The same of the white forces behind slow ones, whose rates of decay, 1/s, are
        `slow_rate_dX` of the diagnostics.
    resonances : tuple of Resonance
        Further modes that random forces move.
    bounds : tuple of Bound
        Known bounds of coefficients: equation, term, least and greatest.
    """

    model: PolynomialModel
    findings: tuple[Finding, ...] = ()
    is_judged: bool = False
    standard_errors: NDArray[np.float64] = NO_ARRAY
    unconditional_errors: NDArray[np.float64] = NO_ARRAY
    detection_limits: NDArray[np.float64] = NO_ARRAY
    covariance: NDArray[np.float64] = NO_ARRAY
    rivals: NDArray[np.float64] = NO_ARRAY
    rival_share: float = 0.0
    extrapolation_shift: NDArray[np.float64] = NO_ARRAY
    extrapolation_covariance: NDArray[np.float64] = NO_ARRAY
    initial_states: NDArray[np.float64] = NO_ARRAY
    sigma: NDArray[np.float64] = NO_ARRAY
    thresholds: NDArray[np.float64] = NO_ARRAY
    chi2: float = np.nan
    known: tuple[int, ...] = ()
    diagnostics: Mapping[str, float | str] = field(default_factory=dict)
    further_modes: tuple[FurtherMode, ...] = ()
    envelope: tuple[EnvelopePart, ...] = ()
    forces: NDArray[np.float64] = NO_ARRAY
    slow_forces: NDArray[np.float64] = NO_ARRAY
    resonances: tuple[Resonance, ...] = ()
    bounds: tuple[Bound, ...] = ()

    def __post_init__(self) -> None:
        for name, shape in _array_shapes(*self.model.coefficients.shape).items():
            if getattr(self, name) is None:
                unstated = 0.0 if name in ("forces", "slow_forces") else np.nan
                object.__setattr__(self, name, np.full([max(n, 0) for n in shape], unstated))
        super().__post_init__()

    @classmethod
    def refused(
        cls,
        states: tuple[str, ...],
        terms: tuple[Exponents, ...],
        findings: Iterable[Finding],
        inputs: tuple[str, ...] = (),
    ) -> IdentifiedModel:
        """Return a result without a model, with the findings that explain why there is none."""
        findings = tuple(findings)
        if status_of(findings) != "refused":
            findings += (Finding.of(Code.NO_MODEL),)
        nothing = np.full((len(states), len(terms)), np.nan)
        model = PolynomialModel(states, terms, nothing, inputs)
        return cls(model, findings, is_judged=True)

    @property
    def status(self) -> str:
        """Status of the model, which follows from its findings (`status_of`).

        `ok`, or `not identifiable`: other terms would fit as well. `approximate`: no model of the
        library is right, and this one is near. `refused`: there is no model. `unjudged`: the model
        was not assessed.
        """
        return status_of(self.findings) if self.is_judged else "unjudged"

    @property
    def support(self) -> NDArray[np.bool_]:
        """Whether each term is present in each identified equation, boolean (n_states, n_terms)."""
        present = np.nan_to_num(self.model.coefficients) != 0
        present[list(self.known)] = False
        return present

    @property
    def is_forced(self) -> bool:
        """Whether the model includes random forces, modelled as a stochastic process."""
        return bool(np.any(self.forces) or np.any(self.slow_forces))

    @property
    def lacks_useful_forecast(self) -> bool:
        """Whether there is no model, or only an approximate model that forecasts poorly."""
        inexact = self.status in ("approximate", "refused")
        return inexact and float(self.diagnostics.get("forecast_r2", 0.0)) < MIN_FORECAST_R2

    def with_findings(self, *findings: Finding) -> IdentifiedModel:
        """Return a copy of the model with further findings, and so perhaps another status."""
        return replace(self, findings=(*self.findings, *findings))

    def has_finding(self, *codes: Code) -> bool:
        """Return whether any finding of the model has one of the given codes."""
        return any(each.code in codes for each in self.findings)

    @property
    def codes(self) -> str:
        """Codes of all findings of the model, separated by spaces."""
        return " ".join(each.code for each in self.findings)

    @property
    def reason(self) -> str:
        """Reason for the status, in one line for people; programs should read `findings`."""
        return reason_of(self.findings)

    @property
    def verdict(self) -> str:
        """Status of the model and the reason for it, in one line."""
        return ": ".join(filter(None, (self.status, self.reason)))

    def recorded(self, name: str) -> tuple[float, ...]:
        """Return the lower and upper end of the recorded range of an input or a state.

        For an input, the range of nine tenths of its samples. For a state, in the model of a
        `Summary`, the range of all its samples. Empty if unknown.
        """
        ends = tuple(f"{name}{end}" for end in RANGE_SUFFIXES)
        return tuple(float(self.diagnostics[end]) for end in ends if end in self.diagnostics)

    def at(self, values: Mapping[str, float]) -> IdentifiedModel:
        """Return the model with some inputs held constant and terms that become equal merged.

        Parameters
        ----------
        values : mapping of str to float
            By input; other inputs remain.

        Returns
        -------
        IdentifiedModel
            With covariance and errors of the merged coefficients.

        Raises
        ------
        ValueError
            As `PolynomialModel.at` does.
        """
        model = self.model.at(values)
        _, merge = merge_inputs(self.model, values)
        support = replace(self, model=model).support
        old, new = np.argwhere(self.support), np.argwhere(support)
        is_same_equation = new[:, :1] == old[:, 0]
        slope = np.where(is_same_equation, merge[old[:, 1]][:, new[:, 1]].T, 0.0)
        fields: dict[str, Any] = {name: np.full(support.shape, np.nan) for name in TERM_FIELDS}
        fields["rivals"] = self.rivals @ merge
        if len(self.covariance):
            fields["covariance"] = slope @ self.covariance @ slope.T
            fields["standard_errors"][tuple(new.T)] = np.sqrt(np.diag(fields["covariance"]))
        if len(self.extrapolation_shift):
            fields["extrapolation_shift"] = slope @ self.extrapolation_shift
            fields["extrapolation_covariance"] = slope @ self.extrapolation_covariance @ slope.T
        with np.errstate(invalid="ignore", divide="ignore"):
            wider = np.fmax(self.unconditional_errors / self.standard_errors, 1.0)
        for k, (i, j) in enumerate(new):
            ratio = np.max(wider[tuple(old[slope[k] != 0].T)], initial=1.0)
            fields["unconditional_errors"][i, j] = ratio * fields["standard_errors"][i, j]
        for name in ("unconditional_errors", "detection_limits"):
            limits = getattr(self, name)
            absent = np.sqrt(np.nan_to_num(limits, posinf=0.0) ** 2 @ merge**2)
            absent[np.isinf(limits) @ (merge != 0.0)] = np.inf
            is_stated = ~support & (absent > 0.0)
            fields[name][is_stated] = absent[is_stated]
        return replace(self, model=model, **fields)

    def equations(self) -> tuple[str, ...]:
        """Return the equation of each state as text, with standard errors if they are known."""
        return self.model.equations(self.standard_errors)

    def __repr__(self) -> str:
        return f"IdentifiedModel of {', '.join(self.model.states)}\n{self}"

    def __str__(self) -> str:
        if self.status == "refused":
            return self.verdict
        lines = list(self.equations())
        modes = [mode for mode in self.further_modes if not mode.is_steady]
        if names := dict.fromkeys(mode.name for mode in modes):
            lines.append(f"not in the equations: {join_words(names)}")
        return "\n".join([*lines, self.verdict])

    def simulate(
        self,
        initial_state: ArrayLike,
        time: ArrayLike,
        inputs: Mapping[str, Input | float] | None = None,
    ) -> Trajectory:
        """Simulate the motion of the model from an initial state and return its trajectory.

        Parameters
        ----------
        initial_state : (n_states,) array
            State at time[0].
        time : (n,) array
            Increasing times, s.
        inputs : mapping of str to Input or float, optional
            Every input of the model by name, measured or constant.

        Returns
        -------
        Trajectory

        Raises
        ------
        ValueError
            If there is no model, or an argument has another form.
        """
        from galloping.trajectory.simulation import (  # compiles; few callers need it
            Simulator,
            escape_distance,
        )

        if self.status == "refused":
            raise ValueError(f"there is no model to simulate: {self.reason}")
        start = checked_state(initial_state, self.model.states)
        simulator = Simulator(self.model.states, self.model.terms, inputs=self.model.inputs)
        return simulator(
            self.model, start, as_increasing("time", time), inputs, escape_distance(start)
        )

    def further_motion(self, time: NDArray[np.float64], recording: int = 0) -> NDArray[np.float64]:
        """Compute the recorded motion in modes that the equations of the model do not contain.

        Returns (n, n_states) at `time` (n,), s from the first sample.
        """
        motion = np.zeros((len(time), len(self.model.states)))
        for mode in self.further_modes:
            if mode.recording == recording:
                motion[:, self.model.states.index(mode.state)] += mode(np.asarray(time, float))
        return motion

    def latex(self) -> str:
        """Return the equations as LaTeX for amsmath; a velocity dX is written as X with a dot."""
        return self.model.latex(self.standard_errors)

    def _repr_latex_(self) -> str | None:
        """Format equations and status for notebooks; None without a model."""
        if self.status == "refused":
            return None
        body = self.latex().removesuffix("\n\\end{aligned}")
        return f"$$\n{body} \\\\\n&\\text{{{self.status}}}\n\\end{{aligned}}\n$$"

    def confidence_limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the lower and upper end of the 95 % interval of each coefficient.

        Returns
        -------
        low, high : (n_states, n_terms) arrays
            Ends of the intervals, inside the bounds of the coefficients. The interval of an absent
            term is its detection limit. NaN if neither is stated.
        """
        present = np.nan_to_num(self.model.coefficients) != 0
        half = np.where(present, NORMAL_95 * self.standard_errors, self.detection_limits)
        low, high = self.model.coefficients - half, self.model.coefficients + half
        place = {term: j for j, term in enumerate(self.model.terms)}
        for i, term, least, most in self.bounds:
            if (j := place.get(term)) is not None:  # the model of `at` lacks merged terms
                low[i, j], high[i, j] = max(low[i, j], least), min(high[i, j], most)
        return low, high

    def to_frame(self, absent: bool = False) -> DataFrame:
        """Return coefficients, errors and intervals as a pandas DataFrame, a row for each term.

        Parameters
        ----------
        absent : bool
            Whether absent terms have rows too.

        Returns
        -------
        DataFrame
            A row for each term of each equation, by the index `equation`, `term`. The columns are
            `coefficient`, `standard_error` (if the terms are right), `unconditional_error` (rival
            models included), `low` and `high`, the ends of the 95 % interval. The interval of an
            absent term is its detection limit. Errors of known coefficients are zero; those of
            known equations are NaN.
        """
        import pandas as pd  # an extra, and slow to import

        model, (low, high) = self.model, self.confidence_limits()
        is_shown = np.full(low.shape, True) if absent else np.nan_to_num(model.coefficients) != 0
        names = model.term_names
        index = pd.MultiIndex.from_tuples(
            [(model.states[i], names[j]) for i, j in np.argwhere(is_shown)],
            names=("equation", "term"),
        )
        columns = {
            "coefficient": model.coefficients, "standard_error": self.standard_errors,
            "unconditional_error": self.unconditional_errors, "low": low, "high": high,
        }  # fmt: skip
        return pd.DataFrame({name: values[is_shown] for name, values in columns.items()}, index)

    def to_plain(self) -> dict[str, object]:
        """Convert the model to plain values for JSON; NaN and infinite numbers become text."""
        model = self.model
        terms = [term_to_plain(term) for term in model.terms]
        content: dict[str, Any] = {"states": model.states, "inputs": model.inputs, "terms": terms}
        values = {"coefficients": model.coefficients, "status": self.status} | self._held()
        del values["model"], values["is_judged"], values["bounds"]
        content |= {name: _as_plain(value) for name, value in values.items()}
        content["reason"] = self.reason
        content["bounds"] = [
            [i, term_to_plain(term), *map(_as_plain, ends)] for i, term, *ends in self.bounds
        ]
        return content | {"known": [int(i) for i in self.known]}

    @classmethod
    def from_plain(cls, content: Mapping[str, Any]) -> IdentifiedModel:
        """Rebuild a model from the plain values of `to_plain`; unknown keys are ignored.

        Raises KeyError, or ValueError and its subclasses, for anything else.
        """
        states, inputs = _parse_names(content["states"]), _parse_names(content["inputs"])
        terms = tuple(map(from_plain, content["terms"]))
        powers = [term[: n_exponents(term)] for term in terms]
        if not terms or any(type(e) is not int or abs(e) > MAX_EXPONENT for e in chain(*powers)):
            raise ValueError(f"terms: must be whole exponents up to {MAX_EXPONENT}")
        if any(e < 0 for exponents in powers for e in exponents[: len(states)]):
            raise ValueError("terms: exponents of states must be 0 or more")
        coefficients, status = np.array(content["coefficients"], float), content["status"]
        model = PolynomialModel(states, terms, coefficients, inputs)
        if status != "refused" and not np.all(np.abs(coefficients) < MAX_COEFFICIENT):
            limit = f"finite and below {MAX_COEFFICIENT:g}"
            raise ValueError(f"coefficients: not all are {limit}, and the status is {status!r}")
        known, bounds = tuple(content["known"]), content.get("bounds", ())
        if not {*known, *(i for i, *_ in bounds)} <= set(range(len(states))):
            raise ValueError(f"known, bounds: must be of equations 0 to {len(states) - 1}")
        shapes = _array_shapes(
            len(states), len(terms), len(content["covariance"]), len(content["extrapolation_shift"])
        )
        identified = cls(
            model=model,
            is_judged=status != "unjudged",
            chi2=float(content["chi2"]),
            rival_share=float(content["rival_share"]),
            known=known,
            diagnostics={
                name: value if name == "path" else float(value)
                for name, value in content["diagnostics"].items()
            },
            further_modes=_parse_records(FurtherMode, content["further_modes"]),
            findings=tuple(Finding(**each) for each in content.get("findings", ())),
            envelope=_parse_records(EnvelopePart, content.get("envelope", ())),
            bounds=tuple(
                (int(i), from_plain(term), float(least), float(most))
                for i, term, least, most in bounds
            ),
            resonances=_parse_records(Resonance, content["resonances"]),
            **{
                name: np.array(content[name], float).reshape(shape)
                for name, shape in shapes.items()
            },
        )
        _check_covariance(identified.covariance, int(identified.support.sum()))
        if identified.status != status:
            raise ValueError(
                f"status: {status!r} contradicts the findings ({identified.codes or 'none'}), from "
                f"which {identified.status!r} follows"
            )
        return identified

    def save(self, path: str | os.PathLike, **about: object) -> None:
        """Write the model to a JSON file.

        Parameters
        ----------
        path : path-like
        **about : object
            Further plain values, such as units, which `load` ignores.
        """
        write_json(path, self.to_plain() | about)

    @classmethod
    def load(cls, path: str | os.PathLike) -> IdentifiedModel:
        """Load a model from a JSON file that `save` wrote.

        Raises ValueError if the file contains something else.
        """
        try:
            content = read_json(path)
            if not isinstance(content, dict):
                raise TypeError("must be a mapping of keys")
            return cls.from_plain(content)
        except KeyError as error:
            raise ValueError(f"{path}: not an identified model: no key {error}") from None
        except (AttributeError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
            cause = " ".join(str(error).split())[:200]
            raise ValueError(f"{path}: not an identified model: {cause}") from None


def _parse_names(content: Iterable[Any]) -> tuple[str, ...]:
    """Parse names of states or inputs. Raises ValueError for anything else."""
    names = tuple(content)
    if not all(
        isinstance(name, str) and name.isprintable() and 0 < len(name) <= MAX_NAME_LENGTH
        for name in names
    ):
        raise ValueError(f"{names!r:.60}: must be names that print, in one line")
    if len(set(names)) < len(names):
        raise ValueError(f"{names!r:.60}: a name is there twice")
    return names


def _check_covariance(covariance: NDArray[np.float64], n_support: int) -> None:
    """Raise ValueError unless a matrix is empty or can be the covariance of n_support numbers."""
    if len(covariance) not in (0, n_support):
        raise ValueError(f"covariance: of {len(covariance)} terms; must be of {n_support}, or []")
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    is_symmetric = np.abs(covariance - covariance.T) <= 1e-6 * np.outer(deviations, deviations)
    if np.any(np.diag(covariance) < 0.0) or not np.all(is_symmetric & np.isfinite(covariance)):
        raise ValueError("covariance: must be finite, symmetric and without negative variances")


def _parse_records(kind: type, contents: Sequence[Mapping[str, Any]]) -> tuple:
    """Parse objects of numbers and names, as `_as_plain` has written them."""

    def parse_value(name: str, plain: Any) -> Any:
        if name in ("recording", "state"):
            return plain
        return tuple(map(float, plain)) if isinstance(plain, list) else float(plain)

    return tuple(
        kind(**{name: parse_value(name, plain) for name, plain in each.items()})
        for each in contents
    )


def _array_shapes(
    states: int, terms: int, support: int = 0, extrapolated: int = 0
) -> dict[str, tuple[int, ...]]:
    """Return the shape of each array of a model, by name; -1 for any length."""
    square = (states, states)
    return dict.fromkeys(TERM_FIELDS, (states, terms)) | {
        "covariance": (support, support), "rivals": (-1, states, terms),
        "extrapolation_shift": (extrapolated,),
        "extrapolation_covariance": (extrapolated, extrapolated),
        "initial_states": (-1, states), "sigma": (-1, states),
        "thresholds": (states,), "forces": square, "slow_forces": square,
    }  # fmt: skip


def _as_plain(value: Any) -> Any:
    """Convert a value for JSON; numbers that are not finite are text."""
    if isinstance(value, Finding):
        return value.as_dict()
    if isinstance(value, FurtherMode | Resonance | EnvelopePart):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {name: _as_plain(each) for name, each in value.items()}
    if isinstance(value, str | int):
        return value
    if isinstance(value, np.ndarray):  # as below, but faster for thousands of numbers
        plain, odd = value.astype(object), ~np.isfinite(value)
        plain[odd] = [str(each) for each in value[odd].tolist()]
        return plain.tolist()
    if np.ndim(value):
        return [_as_plain(each) for each in value]
    return float(value) if np.isfinite(value) else str(float(value))
