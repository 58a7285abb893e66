"""Elementary functions of states, as factors of a term besides powers of states and inputs.

A term is a tuple: exponents of the states, exponents of the inputs, and then the functions that
multiply them, in order. `|dq| dq` of the states q and dq is `(0, 1, Function("abs", (0.0, 1.0)))`.
Arguments and products have a canonical form: sin(-q) is -sin(q), |2 q| is 2 |q|, q sign(q) is |q|.
So equal terms are equal tuples.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Kind:
    """Evaluation, derivative and notation of an elementary function such as sin.

    evaluate: the function of arrays. derivative: by its argument, a number times a product of
    functions of the same argument. text, latex: notation with its argument.
    """

    evaluate: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    derivative: tuple[float, tuple[str, ...]]
    text: str
    latex: str


FUNCTIONS = {
    "sin": Kind(np.sin, (1.0, ("cos",)), "sin({})", r"\sin\left({}\right)"),
    "cos": Kind(np.cos, (-1.0, ("sin",)), "cos({})", r"\cos\left({}\right)"),
    "exp": Kind(np.exp, (1.0, ("exp",)), "exp({})", r"\mathrm{{e}}^{{{}}}"),
    "abs": Kind(np.abs, (1.0, ("sign",)), "|{}|", r"\left|{}\right|"),
    "sign": Kind(np.sign, (0.0, ()), "sign({})", r"\operatorname{{sgn}}\left({}\right)"),
    "inverse": Kind(np.reciprocal, (-1.0, ("inverse", "inverse")), "1/({})", r"\frac{{1}}{{{}}}"),
}
KINKED_FUNCTIONS = ("abs", "sign")  # not differentiable where the argument is zero
MAX_EXP_ARGUMENT = 700.0  # limit of a constant in the argument of exp, which overflows at 709.8


class Function(NamedTuple):
    """Elementary function, such as sin, of an affine combination of the states.

    name: one of FUNCTIONS. weights: (n_states,) of the states, not all zero. offset: added to them.
    `make_function` makes one with the argument in canonical form.
    """

    name: str
    weights: tuple[float, ...]
    offset: float = 0.0

    def argument(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate the argument of the function at each of n states.

        x: (n, n_states or more). Returns (n,).
        """
        columns = [k for k, weight in enumerate(self.weights) if weight]
        return x[:, columns] @ np.array([self.weights[k] for k in columns]) + self.offset

    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate the function, (n,), at states (n, n_states or more)."""
        return FUNCTIONS[self.name].evaluate(self.argument(x))

    @property
    def state(self) -> int | None:
        """Index of the state if the argument is one state alone, else None."""
        states = [k for k, weight in enumerate(self.weights) if weight]
        is_alone = len(states) == 1 and self.weights[states[0]] == 1.0 and self.offset == 0.0
        return states[0] if is_alone else None

    def derivative(self, state: int) -> tuple[float, tuple[Function, ...]]:
        """Return the derivative by a state, as a number and functions that it multiplies."""
        factor, names = FUNCTIONS[self.name].derivative
        return factor * self.weights[state], tuple(self._replace(name=name) for name in names)

    def text(self, names: Sequence[str]) -> str:
        """Format the function as text, such as `sin(q)`, given the names of the states."""
        return FUNCTIONS[self.name].text.format(self.argument_text(names))

    def argument_text(
        self, names: Sequence[str], number: Callable[[float], str] | None = None
    ) -> str:
        """Format the argument of the function as text, given the names of the states.

        names: of the states. number: formats a number; by default to its last digit.
        """
        number = number or (lambda value: repr(value).removesuffix(".0"))
        parts = [
            (weight, name if abs(weight) == 1.0 else f"{number(abs(weight))} {name}")
            for name, weight in zip(names, self.weights, strict=False)
            if weight
        ]
        if self.offset:
            parts.append((self.offset, number(abs(self.offset))))
        (value, text), *others = parts
        signed = (f" {'-' if value < 0.0 else '+'} {part}" for value, part in others)
        return f"{'-' if value < 0.0 else ''}{text}{''.join(signed)}"


def make_function(
    name: str, weights: Sequence[float], offset: float = 0.0
) -> tuple[float, Function]:
    """Make an elementary function in canonical form, and the constant that multiplies it.

    name: one of FUNCTIONS. weights: (n_states,) of the states in the argument. offset: added to
    them. Returns the constant and the function, whose product is the requested function. Raises
    ValueError if there is no function of that name, or if the argument is not finite or has no
    state.
    """
    if name not in FUNCTIONS:
        raise ValueError(f"function: {name!r:.60}; must be one of {', '.join(FUNCTIONS)}")
    weights, offset = tuple(map(float, weights)), float(offset)
    message = f"function: {name} of {weights} + {offset:g}; must be finite, with a state"
    if not all(map(isfinite, (*weights, offset))) or not any(weights):
        raise ValueError(message)
    first, factor, unit = next(filter(None, weights)), 1.0, 1.0
    if name in ("abs", "sign", "inverse"):
        unit = first
        factor = {"abs": abs(first), "sign": np.sign(first), "inverse": 1.0 / first}[name]
    elif name in ("sin", "cos") and first < 0.0:
        unit = -1.0
        factor = -1.0 if name == "sin" else 1.0
    elif name == "exp":
        factor, offset = exp(offset) if offset < MAX_EXP_ARGUMENT else np.inf, 0.0
    if not 0.0 < abs(factor) < np.inf:
        raise ValueError(message)
    # adding zero removes the sign of a negative zero
    weights = tuple(weight / unit + 0.0 for weight in weights)
    return float(factor), Function(name, weights, offset / unit + 0.0)


def term_to_plain(term: Sequence) -> list:
    """Convert a term to a list that JSON can store, with functions as dicts."""
    return [own._asdict() if isinstance(own, Function) else own for own in term]


def from_plain(factors: Sequence) -> tuple:
    """Restore a term from the list that `term_to_plain` makes of it for JSON.

    Raises ValueError, KeyError or TypeError for anything else.
    """
    n = sum(not isinstance(entry, Mapping) for entry in factors)
    if not all(isinstance(entry, int) for entry in factors[:n]):
        raise ValueError(f"terms: {factors!r:.60}; must be whole numbers and then functions")
    scaled_functions = [
        make_function(entry["name"], entry["weights"], entry["offset"]) for entry in factors[n:]
    ]
    if any(factor != 1.0 for factor, _ in scaled_functions):
        raise ValueError(f"terms: {factors[n:]!r:.60}; not in the one spelling of an argument")
    return canonical_term(factors[:n], [function for _, function in scaled_functions])


def n_exponents(term: Sequence[object]) -> int:
    """Return the number of exponents in a term, the entries before its functions."""
    return sum(not isinstance(factor, Function) for factor in term)


def canonical_term(exponents: Sequence[int], functions: Sequence[Function]) -> tuple:
    """Simplify a product of powers and functions to a term in canonical form.

    sign(u)^2 is 1, |u|/u is sign(u); of a state u alone, u sign(u) is |u|, |u|^2 is u^2, u/u is 1.
    """
    exponents, counts = list(exponents), Counter(functions)
    for argument in dict.fromkeys((function.weights, function.offset) for function in functions):
        variants = {name: Function(name, *argument) for name in ("sign", "abs", "inverse")}
        sign, size, inverse = (counts.pop(function, 0) for function in variants.values())
        if (state := variants["sign"].state) is not None:
            odd, power = (sign + size) % 2, exponents[state] + size
            cancelled = min(power, inverse)
            power, inverse = power - cancelled, inverse - cancelled
            size = int(odd and power > 0)
            sign, exponents[state] = odd - size, power - size
        else:
            ratio = min(size, inverse)
            sign, size, inverse = (sign + ratio) % 2, size - ratio, inverse - ratio
        counts.update(dict(zip(variants.values(), (sign, size, inverse), strict=True)))
    return (*exponents, *sorted(counts.elements()))


def multiply_terms(left: Sequence, right: Sequence) -> tuple:
    """Multiply two terms in the same states and inputs."""
    n = n_exponents(left)
    exponents = tuple(a + b for a, b in zip(left[:n], right[:n], strict=True))
    functions = (*left[n:], *right[n:])
    return canonical_term(exponents, functions) if functions else exponents


def differentiate_term(term: Sequence, state: int) -> list[tuple[float, tuple]]:
    """Return the derivative of a term by a state, as a list of (number, term) pairs."""
    n = n_exponents(term)
    exponents, functions = term[:n], term[n:]
    parts = []
    if exponents[state]:
        lower = [e - (k == state) for k, e in enumerate(exponents)]
        parts.append((exponents[state], canonical_term(lower, functions)))
    for function, count in Counter(functions).items():
        factor, derivative = function.derivative(state)
        if factor:
            others = list(functions)
            others.remove(function)
            parts.append((count * factor, canonical_term(exponents, (*others, *derivative))))
    return parts
