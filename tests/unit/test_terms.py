"""The grammar of libraries and of what is known."""

import json
from itertools import product

import numpy as np
import pysindy as ps
import pytest
from hypothesis import given
from hypothesis import strategies as some

from galloping import derive
from galloping.identification.prior_knowledge import Coefficient
from galloping.model.functions import (
    FUNCTIONS,
    from_plain,
    make_function,
    multiply_terms,
    term_to_plain,
)
from galloping.model.polynomial import PolynomialModel, design_matrix, polynomial_library, term_name
from galloping.model.terms import Bounds, known_model, parse_known, parse_library

LINE = ("q_v", "q_w", "dq_v", "dq_w")


def of(name, *argument):
    """A function of the states y and dy."""
    return make_function(name, argument[:2], *argument[2:])[1]


def test_poly_is_the_library_of_that_degree():
    for n, degree in product((1, 2, 4), (0, 1, 3)):
        states = LINE[:n]
        assert parse_library(f"poly({', '.join(states)}; {degree})", states) == (
            polynomial_library(n, degree),
            None,
        )


@pytest.mark.parametrize(
    ("text", "terms"),
    [
        ("1 + y*dy", {(0, 0, 0), (1, 1, 0)}),
        ("y dy^2 + y**2*dy", {(1, 2, 0), (2, 1, 0)}),
        ("(y + dy)^2", {(2, 0, 0), (1, 1, 0), (0, 2, 0)}),
        ("u*poly(y; 1)", {(0, 0, 1), (1, 0, 1)}),
        ("poly(y, u; 1)", {(0, 0, 0), (1, 0, 0), (0, 0, 1)}),
        ("dy^3/u + y u^-2", {(0, 3, -1), (1, 0, -2)}),
        ("y + y + 1 y", {(1, 0, 0)}),
        ("|dy| dy", {(0, 1, 0, of("abs", 0, 1))}),
        ("dy^2 sign(dy)", {(0, 1, 0, of("abs", 0, 1))}),
        ("y abs(dy) |dy|", {(1, 2, 0)}),
        ("u*sin(2 y - dy/2)", {(0, 0, 1, of("sin", 2, -0.5))}),
        ("sign(-3 y) + |2 y|", {(0, 0, 0, of("sign", 1, 0)), (0, 0, 0, of("abs", 1, 0))}),
        ("u/(2 y + 3)^2", {(0, 0, 1, of("inverse", 1, 0, 1.5), of("inverse", 1, 0, 1.5))}),
        ("dy^-1 + y/dy", {(0, 0, 0, of("inverse", 0, 1)), (1, 0, 0, of("inverse", 0, 1))}),
        ("dy^2/dy + 1/dy^-2", {(0, 1, 0), (0, 2, 0)}),
    ],
)
def test_sums_multiply_out(text, terms):
    assert set(parse_library(text, ("y", "dy"), ("u",))[0]) == terms


WEIGHTS = some.floats(-600, 600).map(lambda value: round(value, 3))
ARGUMENTS = some.tuples(WEIGHTS, WEIGHTS, WEIGHTS).filter(lambda own: any(own[:2]))
FACTORS = some.tuples(some.sampled_from(sorted(FUNCTIONS)), ARGUMENTS)


@given(
    some.lists(some.integers(0, 4), min_size=2, max_size=2),
    some.integers(-3, 3),
    some.lists(FACTORS, max_size=3),
)
def test_a_term_is_read_as_it_is_printed(powers, of_input, factors):
    term = (*powers, of_input)
    for name, argument in factors:
        term = multiply_terms(term, (0, 0, 0, of(name, *argument)))
    assert parse_library(term_name(term, ("y", "dy", "u")), ("y", "dy"), ("u",))[0] == (term,)
    assert from_plain(json.loads(json.dumps(term_to_plain(term)))) == term


def test_libraries_add_up_and_may_differ_between_equations():
    terms, mask = parse_library(["y, dy: dy", "dy: y + u/1", "dy: y"], ("y", "dy"), ("u",))
    assert terms == ((0, 1, 0), (1, 0, 0), (0, 0, 1))
    assert mask.tolist() == [[True, False, False], [True, True, True]]


def test_wind_is_the_quasi_static_law():
    """At a wind speed U the model of a line in U is one of the terms, with powers 2 - p of U."""
    terms, mask = parse_library("wind(U)", LINE, ("T", "U"))
    assert parse_library("wind", LINE, ("U",))[0] == tuple((*term[:4], term[5]) for term in terms)
    for term in np.array(terms)[mask[2] & mask[3]]:
        factors = term[2:4].sum()
        assert term[4] == 0 and (term[5] == 0 or term[5] == 2 - factors)
    lines = {wind: derive(wind={"speed": wind}) for wind in (8.0, 12.0)}
    for line in lines.values():
        for equation, row in enumerate(line.coefficients):
            for j in np.flatnonzero(row):
                own = [term[:4] == line.terms[j] for term in terms]
                assert np.any(mask[equation, own])
    cubic = lines[8.0].terms.index((0, 0, 3, 0))
    fall = [line.coefficients[2, cubic] * wind for wind, line in lines.items()]
    assert fall[0] == pytest.approx(fall[1])  # as dq_v^3/U of the library does


@pytest.mark.parametrize(
    ("text", "character"),
    [
        ("", 1), ("y +", 4), ("y $ dy", 3), ("(y", 3), ("poly(y dy; 3)", 8), ("poly(y; 1.5)", 9),
        ("y^99", 3), ("y + U*dy", 5), ("2*y", 1), ("y 3", 3), ("y - dy", 3), ("u/(u + 1)", 2),
        ("1/sin(y)", 2), ("y/2", 3), ("sin(u)", 1), ("|y dy|", 1), ("exp(1)", 1), ("y + |dy", 5),
        ("|y| dy|", 7), ("tan(y)", 1), ("wind(v)", 6), ("x: y", 1),
    ],
)  # fmt: skip
def test_an_error_points_at_the_character(text, character):
    with pytest.raises(ValueError) as error:
        parse_library(text, ("y", "dy"), ("u",))
    message = str(error.value)
    assert message.startswith(f"library {text!r}, character {character}: ") and "\n" not in message


def test_wind_needs_one_speed_and_velocities():
    for inputs in ((), ("u", "v")):
        with pytest.raises(ValueError, match=r"^library "):
            parse_library("wind", ("y", "dy"), inputs)
    with pytest.raises(ValueError, match="'z' has no dz"):
        parse_library("wind", ("y", "dy", "z"), ("u",))
    # the input of that name
    assert parse_library("wind*dy", ("y", "dy"), ("wind",)) == (((0, 1, 1),), None)


def test_known_equations_are_read_as_they_are_printed():
    states, terms = ("q", "dq"), polynomial_library(2, 3)
    for text in ("dq=-3.5 q - 2e-2*dq + q^2 dq", "d(dq)/dt = -3.5*q - 0.02*dq + q**2*dq"):
        model, named, _ = known_model([text], states, terms)
        assert named == ("dq",)
        row = dict(zip(model.term_names, model.coefficients[1], strict=True))
        assert {n: c for n, c in row.items() if c} == {"q": -3.5, "dq": -0.02, "q^2 dq": 1.0}
    for wrong in ("dq", "x=q", "dq=2 y", "dq=q q q q", "dq=q dq 3", "dq=q^-1", "dq=tan(q)",
                  "dq=sin(q)", "dq=1e999 q", "dq=(-3.5 ± 0.1) q", "dq=q/0",
                  "dq=-3,5 q"):  # fmt: skip
        with pytest.raises(ValueError, match=r"known .*(must|finite|library|neither|div|underst)"):
            known_model([wrong], states, terms)
    with pytest.raises(ValueError, match="twice"):
        known_model(["q=dq", "q=dq"], states, terms)


def test_a_coefficient_is_known_or_has_a_prior():
    for text, deviation in (("+- 0.005", 0.005), ("± 5e-3", 0.005), ("", 0.0)):
        known = parse_known(f"dy: u*dy = -0.02 {text}", ("y", "dy"), ("u",))
        assert (known.state, known.terms, known.deviation) == ("dy", {(0, 1, 1): -0.02}, deviation)
    for wrong in ("dy: 2 dy = 3", "dy: y + dy = 3", "dy: y = 3 +- 0", "dy: y = 1e999", "dy: y"):
        with pytest.raises(ValueError, match=r"known .* character \d+: .*(must|needed)"):
            parse_known(wrong, ("y", "dy"), ("u",))


def test_a_coefficient_may_be_bounded():
    for text, lower, upper in (
        ("dy < 0", -np.inf, 0.0),
        ("0 >= dy", -np.inf, 0.0),
        ("dy > -2.5e-1", -0.25, np.inf),
        ("-1 < dy <= 2", -1.0, 2.0),
        ("2 > dy > -1", -1.0, 2.0),
    ):
        assert parse_known(f"dy: {text}", ("y", "dy")) == Bounds("dy", (0, 1), lower, upper)
    assert parse_known("dy: 1 < 0.5", ("y", "dy")).term == (0, 0)
    for wrong in ("2 dy < 3", "y < dy", "y + dy < 0", "1 < dy < 0", "0 < dy > 1", "dy < 1e999"):
        with pytest.raises(ValueError, match=r"known .* character 1: "):
            parse_known(f"dy: {wrong}", ("y", "dy"))
    both = ["dy: dy < 0", "dy: dy = -1 +- 0.5"]
    assert len(known_model(both, ("y", "dy"), polynomial_library(2, 1))[2]) == 2
    with pytest.raises(ValueError, match="twice"):
        known_model(["dy: dy < 0", "dy: dy > -1"], ("y", "dy"), polynomial_library(2, 1))


@pytest.mark.parametrize("n_states", [1, 2, 4])
@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_library_is_that_of_pysindy(n_states, degree):
    terms = polynomial_library(n_states, degree)
    x = np.random.default_rng(0).standard_normal((20, n_states))
    theirs = ps.PolynomialLibrary(degree=degree)
    assert design_matrix(x, terms) == pytest.approx(np.asarray(theirs.fit_transform(x)), rel=1e-12)
    model = PolynomialModel(LINE[:n_states], terms, np.zeros((n_states, len(terms))))
    assert list(model.term_names) == theirs.get_feature_names(list(model.states))


def test_model_on_another_library():
    model = PolynomialModel(("a", "b"), ((1, 0), (0, 3)), np.array([[1.0, 2.0], [0.0, 3.0]]))
    x = np.array([[0.5, 2.0]])
    assert model(x) == pytest.approx(np.array([[16.5, 24.0]]))
    assert model.on_library(polynomial_library(2, 3))(x) == pytest.approx(model(x))
    assert model.support.sum() == 3


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("poly(q, dq, U, V; 12)", "1820.*600"), ("((1 + q + dq + U)^12)^12", "651.*600"),
        ("(1 + q)^12 * (1 + dq)^12 * (1 + U)^12", "600"), ("((((q^12)^12)^12)^12)^12", "24.*12"),
        ("(" * 3000 + "q" + ")" * 3000, "library"), ("q" * 20_000, "20000.*10000"),
        ("poly(q; " + "9" * 5000 + ")", "12"), ("*".join(["q"] * 3000), "13.*12"),
    ],
)  # fmt: skip
def test_what_would_take_long_is_refused_before_any_work(text, said):
    with pytest.raises(ValueError, match=said) as fault:
        parse_library(text, ("q", "dq"), ("U", "V"))
    assert "\n" not in str(fault.value) and len(str(fault.value)) < 300


@pytest.mark.parametrize(
    ("mean", "deviation"), [(1.0, 1e-200), (0.0, 1e-200), (1.0, 1e200), (1e300, 1.0), (1.0, 1e-10)]
)
def test_what_is_known_can_be_squared(mean, deviation):
    with pytest.raises(ValueError, match=r"coefficient: (mean|deviation)"):
        Coefficient("q", (1,), mean, deviation)


@given(some.lists(FACTORS, min_size=1, max_size=3), some.integers(0, 2), some.integers(0, 2))
def test_a_term_with_functions_has_the_values_and_slopes_of_its_factors(factors, p, r):
    """However it is spelled, where no factor has a kink or a pole nearby."""
    x = np.random.default_rng(0).uniform(-2.0, 2.0, (40, 2))
    term, value = (p, r), x[:, 0] ** p * x[:, 1] ** r
    for name, argument in factors:
        argument = tuple(value / 1e3 for value in argument)
        factor, own = make_function(name, argument[:2], argument[2])
        term = multiply_terms(term, (0, 0, own))
        about = x @ argument[:2] + argument[2]
        apart = np.abs(about) > 1e-2 * np.abs(argument[:2]).max()
        value = value * FUNCTIONS[name].evaluate(about) / factor
        x, value = x[apart], value[apart]
    assert design_matrix(x, (term,))[:, 0] == pytest.approx(value, rel=1e-9, abs=1e-12)
    model, step = PolynomialModel(("y", "dy"), (term,), np.array([[1.0], [2.0]])), 1e-6
    slopes = [(model(x + step * e) - model(x - step * e)) / (2.0 * step) for e in np.eye(2)]
    size = 1.0 + np.abs(model.jacobian(x)).max(initial=0.0)
    assert model.jacobian(x) == pytest.approx(np.stack(slopes, axis=2), abs=1e-4 * size)


def test_what_is_no_function_is_said():
    for name, weights, offset in (("tan", (1, 0), 0), ("sin", (0, 0), 1), ("exp", (1,), 1e3)):
        with pytest.raises(ValueError, match=r"^function: "):
            make_function(name, weights, offset)
    with pytest.raises(ValueError, match="2 weights"):
        PolynomialModel(("y", "dy"), ((0, 0, make_function("sin", (1.0,))[1]),), np.zeros((2, 1)))
