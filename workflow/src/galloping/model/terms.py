"""Grammar of libraries and of known equations, the same in command, mapping and Python.

A library is a sum of terms of states and measured inputs, without coefficients:

    poly(q_v, q_w, dq_v, dq_w; 3) + U*dq_v + dq_v^3/U      in every equation
    dq_v, dq_w: U^2 + U*(dq_v + dq_w)                      in these equations alone
    |dq_v| dq_v + sign(dq_v) + sin(q_v) + 1/(q_v + 3)      functions of states
    wind(U)                                                terms of the quasi-static law

`poly` contains all monomials of its names up to a degree, and sums in brackets are expanded.
Functions are sin, cos, exp, sign, abs or bars, and division; their argument is a sum of states,
with coefficients, such as `sin(2 q_v - q_w)`. Several libraries are added. Prior knowledge is
written in the same terms: a whole equation, `dq_w = -9.2 q_w - 0.03 dq_w`, one coefficient,
`dq_v: U*dq_v = 0.02 +- 0.005`, or its bounds, `dq_v: -0.1 < dq_v < 0`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from math import comb, isfinite
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from galloping.model.functions import make_function, multiply_terms, n_exponents
from galloping.model.polynomial import (
    Exponents,
    PolynomialModel,
    has_functions,
    term_name,
    velocity_pairs,
)

if TYPE_CHECKING:
    from lark import Lark, Token

GRAMMAR = r"""
library: [scope] sum
scope: NAME ("," NAME)* ":"

?known: equation | coefficient | bounded
equation: (NAME | _RATE NAME _BY_TIME) "=" sum
coefficient: NAME ":" sum "=" number [("+-" | "±") number]
number: [SIGN] NUMBER
bounded: NAME ":" sum RELATION sum [RELATION sum]

sum: [SIGN] product (SIGN product)*
product: _power ([TIMES | BY] _power)*
_power: atom | raised
raised: atom _POWER number
?atom: NAME -> name
    | NUMBER -> constant
    | "(" sum ")"
    | _POLY NAME ("," NAME)* ";" NUMBER ")" -> poly
    | _WIND NAME ")" -> wind
    | FUNCTION sum ")" -> function
    | OPEN sum CLOSE -> function

_POLY.2: /poly\s*\(/
_WIND.2: /wind\s*\(/
FUNCTION.2: /(sin|cos|exp|abs|sign)\s*\(/
OPEN: "⟦"
CLOSE: "⟧"
_RATE.2: /d\s*\(/
_BY_TIME: /\)\s*\/\s*dt\b/
_POWER.2: "**" | "^"
RELATION: "<=" | ">=" | "<" | ">"
SIGN: "+" | "-"
TIMES: "*"
BY: "/"
NUMBER: /(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?/
NAME: /[^\W\d]\w*/
%ignore /\s+/
"""
TERMINAL_WORDS = {  # words of messages, by terminal; messages omit the other terminals
    "NAME": "a name", "NUMBER": "a number", "RPAR": ")", "SEMICOLON": "; and a degree",
    "EQUAL": "=", "COLON": ":", "COMMA": "a comma", "CLOSE": "|",
}  # fmt: skip
MAX_POWER = 12  # largest power of a name in a term, and largest degree of `poly`
# Any text within these bounds is parsed in a short time.
MAX_CHARACTERS = 10_000  # largest number of characters of a text
MAX_NESTING = 50  # largest depth of nested brackets in a text
MAX_TERMS = 600  # largest number of terms of an expanded text
ELASTIC_DEGREE = 3  # degree of the elastic forces of `wind`

Sum: TypeAlias = dict[Exponents, float]  # coefficients by term
Node: TypeAlias = Any  # a Tree or Token of lark, depending on the rule of the grammar


def parse_library(
    texts: str | Sequence[str], states: Sequence[str], inputs: Sequence[str] = ()
) -> tuple[tuple[Exponents, ...], NDArray[np.bool_] | None]:
    """Parse a library of candidate terms from text such as `poly(q, dq; 3) + sin(q)`.

    It is a sum of terms without coefficients, `poly(q, dq; 3) + U*dq + |dq| dq`, optionally for
    some equations alone, `dq: U^2`. `poly` contains all monomials of its names up to a degree.
    Functions are sin, cos, exp, sign, abs or bars, and division. `wind(U)` contains the terms of
    the quasi-static law.

    Parameters
    ----------
    texts : str or sequence of str
        Several are added.
    states : sequence of str
        Names of the n_states states.
    inputs : sequence of str
        Names of the inputs.

    Returns
    -------
    terms : tuple of Exponents
        Exponents of the states and then of the inputs, and functions, of n_terms terms.
    allowed : (n_states, n_terms) boolean array or None
        Equations in which each term may be; None if all may be in all.

    Raises
    ------
    ValueError
        If the text is no library, in one line that names the character.
    """
    texts = [texts] if isinstance(texts, str) else list(texts)
    allowed: list[Sum] = [{} for _ in states]
    for text in texts:
        sentence = _Sentence("library", text, tuple(states), tuple(inputs))
        for equation, right in sentence.parse_equations():
            allowed[equation] |= right
    terms = tuple(dict.fromkeys(term for right in allowed for term in right))
    mask = np.array([[term in right for term in terms] for right in allowed])
    return terms, None if mask.all() else mask


@dataclass(frozen=True)
class Known:
    """Prior knowledge of a model: a known equation, or a known coefficient of a term.

    state: of the equation. terms: coefficients by term: all of the equation, or, if `deviation` is
    not None, a single one, the prior mean, with its standard deviation, zero if it is fixed.
    """

    state: str
    terms: Sum
    deviation: float | None = None


@dataclass(frozen=True)
class Bounds:
    """Known lower and upper bound of one coefficient of a model.

    state: of the equation. term: of the coefficient. lower, upper: the range, infinite if open.
    """

    state: str
    term: Exponents
    lower: float
    upper: float


def known_model(
    texts: Sequence[str],
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
    inputs: tuple[str, ...] = (),
) -> tuple[PolynomialModel, tuple[str, ...], tuple[Known | Bounds, ...]]:
    """Parse prior knowledge from text: known equations, known coefficients and their bounds.

    Returns a model on the library with the known equations, their states, and the single
    coefficients and bounds. Raises ValueError, in one line, if one cannot be read, has a term
    outside the library or occurs twice.
    """
    coefficients = np.zeros((len(states), len(terms)))
    equations: list[str] = []
    single: list[Known | Bounds] = []
    single_keys: set[tuple] = set()
    for text in texts:
        prior = parse_known(text, states, inputs)
        prior_terms = (prior.term,) if isinstance(prior, Bounds) else tuple(prior.terms)
        for term in prior_terms:
            if term not in terms:
                name = term_name(term, states + inputs)
                raise ValueError(f"known term {name} is not in the library")
        if prior.state in equations or (type(prior), prior.state, prior_terms) in single_keys:
            raise ValueError(f"known {text!r}: is said twice")
        if isinstance(prior, Bounds) or prior.deviation is not None:
            single.append(prior)
            single_keys.add((type(prior), prior.state, prior_terms))
            continue
        equations.append(prior.state)
        places = [terms.index(term) for term in prior_terms]
        coefficients[states.index(prior.state), places] = list(prior.terms.values())
    return PolynomialModel(states, terms, coefficients, inputs), tuple(equations), tuple(single)


def parse_model(text: str, inputs: Sequence[str] = ()) -> PolynomialModel:
    """Parse the text of equations, such as `q = dq; dq = -4 q`, to a model.

    Parameters
    ----------
    text : str
        One equation for each state, separated by `;`, one of which may follow the last, such as
        `q = dq; dq = -9.81 sin(q) - 0.1 dq`; the states are on the left-hand sides.
    inputs : sequence of str
        Names of the inputs.

    Returns
    -------
    PolynomialModel

    Raises
    ------
    ValueError
        If an equation cannot be read, or a state has two.
    """
    if not isinstance(text, str):
        raise ValueError(f"text: {text!r:.60}; must be text, such as 'q = dq; dq = -4 q'")
    texts, inputs = text.rstrip().removesuffix(";").split(";"), tuple(inputs)
    heads = [
        re.sub(r"^d\s*\(|\)\s*/\s*dt$", "", equation.partition("=")[0].strip())
        for equation in texts
    ]
    states = tuple(head.strip() for head in heads)
    terms: dict[Exponents, None] = {}
    for state, equation_text in zip(states, map(str.strip, texts), strict=True):
        if states.count(state) > 1:
            raise ValueError(f"{equation_text!r}: {state!r} has two equations; must have one")
        sentence = _Sentence("known", equation_text, states, inputs, "equation")
        equation = None if ":" in state else sentence.known()
        if not isinstance(equation, Known) or equation.deviation is not None:
            raise ValueError(f"{equation_text!r}: must be an equation, such as 'q = dq'")
        terms |= dict.fromkeys(equation.terms)
    return known_model(texts, states, tuple(terms), inputs)[0]


def parse_known(text: str, states: Sequence[str], inputs: Sequence[str] = ()) -> Known | Bounds:
    """Parse the text of a known equation, a known coefficient or its bounds.

    They are written as `STATE = SUM`, `STATE: TERM = VALUE +- DEVIATION`, and
    `STATE: TERM < VALUE`. Raises ValueError as `parse_library` does.
    """
    return _Sentence("known", text, tuple(states), tuple(inputs)).known()


@cache
def _make_grammar() -> Lark:
    from lark import Lark  # an import that few models need

    return Lark(GRAMMAR, parser="lalr", start=["library", "known"], maybe_placeholders=True)


@dataclass(frozen=True)
class _Sentence:
    """Text in the grammar, of these states and inputs.

    kind: start symbol of the grammar. label: what messages call the text, by default its kind.
    """

    kind: str
    text: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    label: str = ""

    def tree(self) -> Node:
        from lark.exceptions import UnexpectedInput

        if len(self.text) > MAX_CHARACTERS:
            message = f"{len(self.text)} characters are more than {MAX_CHARACTERS}"
            raise ValueError(f"{self.label or self.kind} {self.text:.60}...: {message}")
        depth = 0
        for position, character in enumerate(self.text):
            depth += (character == "(") - (character == ")")
            if depth > MAX_NESTING:
                raise self.fault(position, f"more than {MAX_NESTING} brackets within each other")
        # opening and closing brackets remove the ambiguity of bars; one character keeps positions
        text = re.sub(r"\|([^|]*)\|", r"⟦\1⟧", self.text)
        try:
            return _make_grammar().parse(text, start=self.kind)
        except UnexpectedInput as error:
            expected = getattr(error, "accepts", None) or getattr(error, "allowed", None) or ()
            words = [word for name, word in TERMINAL_WORDS.items() if name in expected]
            token = getattr(error, "token", None)
            if token is not None and token.type == "$END":
                position, message = len(self.text.rstrip()), "more is needed here"
            else:
                position = error.pos_in_stream or 0
                what = self.text[position : position + len(token or " ")]
                message = f"{what!r} is not understood here"
            hint = f"; must be {' or '.join(words)}" if 0 < len(words) < 4 else ""
            raise self.fault(position, f"{message}{hint}") from None

    def fault(self, position: int | Token, message: str) -> ValueError:
        at: Any = getattr(position, "start_pos", position)
        text = self.text if len(self.text) < 200 else f"{self.text:.60}..."
        return ValueError(f"{self.label or self.kind} {text!r}, character {at + 1}: {message}")

    def times(self, left: Sum, right: Sum, position: Token | None) -> Sum:
        """Multiply two sums. Raises ValueError for too many terms or too high a power."""
        result: Sum = {}
        for one, a in left.items():
            for other, b in right.items():
                term = multiply_terms(one, other)
                result[term] = result.get(term, 0.0) + a * b
            self.check_count(len(result), position)
        highest = max(max(map(abs, term[: n_exponents(term)])) for term in result)
        if highest > MAX_POWER:
            raise self.fault(position or 0, f"a power of {highest} is more than {MAX_POWER}")
        return result

    def check_count(self, terms: int, position: Token | None) -> None:
        if terms > MAX_TERMS:
            raise self.fault(position or 0, f"{terms} terms are too many; at most {MAX_TERMS}")

    def parse_equations(self) -> Iterator[tuple[int, Sum]]:
        """Yield the terms of a library for each of its equations."""
        scope, right = self.tree().children
        scoped = None if scope is None else [self.state(name) for name in scope.children]
        for equation in range(len(self.states)) if scoped is None else scoped:
            yield equation, self.sum(right, equation)

    def known(self) -> Known | Bounds:
        tree = self.tree()
        name, right, *numbers = tree.children
        equation = self.state(name)
        if tree.data == "bounded":
            return self.bounds(name, [right, *numbers], equation)
        terms = self.sum(right, equation)
        if not numbers:
            if not all(map(isfinite, terms.values())):
                raise self.fault(name, "a coefficient is not finite")
            return Known(name.value, terms)
        mean = self.number(numbers[0])
        deviation = None if numbers[1] is None else self.number(numbers[1])
        if list(terms.values()) != [1.0]:
            raise self.fault(name, "must be one term, without a number, before the =")
        if not isfinite(mean):
            raise self.fault(numbers[0].children[1], "must be finite")
        if deviation is not None and not 0.0 < deviation < np.inf:
            raise self.fault(numbers[1].children[1], "the deviation must be above 0")
        return Known(name.value, dict.fromkeys(terms, mean), deviation or 0.0)

    def bounds(self, name: Token, parts: Sequence[Node], equation: int) -> Bounds:
        """Convert sums with relations between them: one is the term, the others are numbers."""
        sums = [self.sum(part, equation) for part in parts[::2] if part is not None]
        relations = [relation[0] for relation in parts[1::2] if relation is not None]
        constant = self.monomial(())
        values = [terms.get(constant, 0.0) if set(terms) <= {constant} else None for terms in sums]
        term_index = 1 if len(sums) == 3 else int(values[0] is not None and values[1] is None)
        if list(sums[term_index].values()) != [1.0]:
            raise self.fault(name, "must be one term, without a number, and its bounds")
        ends = {"<": np.inf, ">": -np.inf}  # on the side to which a relation opens
        for k, relation in enumerate(relations):
            other = k if k + 1 == term_index else k + 1
            side = relation if other > term_index else "<>"[relation == "<"]
            value = values[other]
            if value is None or not isfinite(value):
                raise self.fault(name, "a bound must be a finite number")
            if not np.isinf(ends[side]):
                raise self.fault(name, "two bounds are on one side")
            ends[side] = value
        lower, upper = ends[">"], ends["<"]
        if not lower < upper:
            raise self.fault(name, f"no number is between {lower:g} and {upper:g}")
        return Bounds(name.value, next(iter(sums[term_index])), lower, upper)

    def state(self, name: Token) -> int:
        if name not in self.states:
            message = f"{name.value!r} is no state; must be one of {', '.join(self.states)}"
            raise self.fault(name, message)
        return self.states.index(name)

    def number(self, tree: Node) -> float:
        sign, number = tree.children
        return float(f"{sign or ''}{number}")

    def sum(self, tree: Node, equation: int, is_argument: bool = False) -> Sum:
        """Collect coefficients by term; in a library all are one, except in arguments."""
        bare = self.kind == "library" and not is_argument
        total: Sum = {}
        for sign, product in zip(tree.children[::2], tree.children[1::2], strict=True):
            if sign == "-" and bare:
                raise self.fault(sign, "a library lists terms without signs; must be +")
            for term, value in self.product(product, equation, is_argument).items():
                total[term] = total.get(term, 0.0) + (-value if sign == "-" else value)
            self.check_count(len(total), None)
        return dict.fromkeys(total, 1.0) if bare else total

    def product(self, tree: Node, equation: int, is_argument: bool) -> Sum:
        first, *others = tree.children
        result = self.factor(first, equation, is_argument)
        for sign, factor in zip(others[::2], others[1::2], strict=True):
            if sign is None and factor.data == "constant":
                message = "a number is not understood here; it stands first, or behind * or /"
                raise self.fault(factor.children[0], message)
            convert = self.divided if sign == "/" else self.factor
            result = self.times(result, convert(factor, equation, is_argument, sign), sign)
        return result

    def divided(self, tree: Node, equation: int, is_argument: bool, position: Token) -> Sum:
        """Convert one over a factor."""
        if tree.data == "raised":
            return self.raised(tree, equation, is_argument, position)
        return self.inverse(
            self.factor(tree, equation, is_argument or tree.data == "sum"), position
        )

    def factor(self, tree: Node, equation: int, is_argument: bool, _: object = None) -> Sum:
        if tree.data == "sum":
            return self.sum(tree, equation, is_argument)
        if tree.data == "raised":
            return self.raised(tree, equation, is_argument)
        name = tree.children[0]
        if tree.data == "function":
            return self.function(name, tree.children[1], equation)
        if tree.data == "constant":
            if self.kind == "library" and not is_argument and float(name) != 1.0:
                raise self.fault(name, "a library has terms, not coefficients; must be 1")
            return {self.monomial(()): float(name)}
        if tree.data == "poly":
            *names, degree = tree.children
            places, most = [self.name(each) for each in names], self.power(degree)
            self.check_count(comb(len(places) + most, most), degree)
            return {self.monomial(own): 1.0 for own in _list_factors(places, most)}
        if tree.data == "wind" or (name == "wind" and "wind" not in self.states + self.inputs):
            return self.wind(name, equation, tree.data == "wind")
        return {self.monomial([self.name(name)]): 1.0}

    def function(self, name: Token, argument: Node, equation: int) -> Sum:
        """Convert a function of a sum of states. name: with its bracket, or an opening bar."""
        kind = "abs" if name.type == "OPEN" else name.rstrip("(").rstrip()
        weights = self.combination(self.sum(argument, equation, is_argument=True))
        if weights is None:
            requirement = f"must be of a sum of states, such as {kind}(2 {self.states[0]})"
            raise self.fault(name, f"{kind} {requirement}")
        return self.applied(kind, weights, name)

    def applied(self, kind: str, weights: Sequence[float], position: Token) -> Sum:
        """Apply a function to a combination of states, as of `combination`."""
        try:
            factor, function = make_function(kind, weights[:-1], weights[-1])
        except ValueError as error:
            raise self.fault(position, str(error)) from None
        return {(*self.monomial(()), function): factor}

    def combination(self, terms: Sum) -> list[float] | None:
        """Write a sum as weights of the states and a number; None if it is not affine."""
        weights = [0.0] * (len(self.states) + 1)
        for term, value in terms.items():
            exponents, others = term[: len(self.states)], term[len(self.states) :]
            if any(others) or sum(exponents) > 1:
                return None
            weights[exponents.index(1) if any(exponents) else -1] = value
        return weights if any(weights[:-1]) else None

    def raised(
        self, tree: Node, equation: int, is_argument: bool, division_sign: Token | None = None
    ) -> Sum:
        """Convert a power. division_sign: the sign of a division by it."""
        base, number = tree.children
        sign, digits = number.children
        convert = self.divided if (sign == "-") != (division_sign is not None) else self.factor
        power = self.power(digits)
        factor = convert(base, equation, is_argument, division_sign or sign)
        result: Sum = {self.monomial(()): 1.0}
        for _ in range(power):
            result = self.times(result, factor, digits)
        return result

    def power(self, digits: Token) -> int:
        if not digits.isdigit() or len(digits) > 4 or int(digits) > MAX_POWER:
            message = f"{digits.value:.20} is not allowed; must be a whole number up to {MAX_POWER}"
            raise self.fault(digits, message)
        return int(digits)

    def inverse(self, terms: Sum, position: Token) -> Sum:
        if (weights := self.combination(terms)) is not None:
            return self.applied("inverse", weights, position)
        (term, value), *others = terms.items()
        if others or has_functions(term):
            message = "only numbers, inputs, states and sums of states can be divided by"
            raise self.fault(position, message)
        if not value:
            raise self.fault(position, "zero cannot be divided by")
        n = len(self.states)
        result: Sum = {tuple([0] * n + [-e for e in term[n:]]): 1.0 / value}
        for k, power in enumerate(term[:n]):
            unit = [float(i == k) for i in range(n)] + [0.0]
            for _ in range(power):
                result = self.times(result, self.applied("inverse", unit, position), position)
        return result

    def name(self, name: Token) -> int:
        names = self.states + self.inputs
        if name not in names:
            inputs = ", ".join(self.inputs) or "there are none"
            message = f"{name.value!r} is neither a state ({', '.join(self.states)}) nor an input"
            message = f"{message} ({inputs})"
            if self.text[name.end_pos :].lstrip().startswith("("):
                message += ", nor a function (sin, cos, exp, abs, sign)"
            raise self.fault(name, message)
        return names.index(name)

    def monomial(self, places: Sequence[int]) -> Exponents:
        return tuple(places.count(k) for k in range(len(self.states + self.inputs)))

    def wind(self, name: Token, equation: int, is_named: bool) -> Sum:
        """List the terms of a quasi-static load: p velocities have the factor U^(2 - p).

        The equation of a displacement has its velocity. That of a velocity has a structure without
        wind, elastic forces to the third degree and linear damping, and aerodynamics to the third
        degree.
        """
        pairs = velocity_pairs(self.states)
        if is_named and name not in self.inputs:
            inputs = ", ".join(self.inputs) or "there are none"
            raise self.fault(name, f"{name.value!r} is no input ({inputs})")
        if not is_named and len(self.inputs) != 1:
            inputs = ", ".join(self.inputs) or "none yet"
            message = f"wind needs the input that is the wind speed ({inputs}), such as wind(U)"
            raise self.fault(name, message)
        if equation in pairs:
            return {self.monomial([pairs[equation]]): 1.0}
        if equation not in pairs.values():
            state = self.states[equation]
            message = f"wind is of displacements and velocities, and {state!r} has no d{state}"
            raise self.fault(name, message)
        speed = self.name(name) if is_named else len(self.states)
        displacements, velocities = list(pairs), list(pairs.values())
        terms = [self.monomial(factors) for factors in _list_factors(displacements, ELASTIC_DEGREE)]
        terms += [self.monomial([velocity]) for velocity in velocities]
        for factors in _list_factors(velocities, 3):
            term = list(self.monomial(factors))
            term[speed] = 2 - len(factors)
            terms.append(tuple(term))
        return dict.fromkeys(terms, 1.0)


def _list_factors(places: Sequence[int], degree: int) -> Iterator[tuple[int, ...]]:
    """List the factors of every monomial up to a degree, in the order of `polynomial_library`."""
    for power in range(degree + 1):
        yield from combinations_with_replacement(places, power)
