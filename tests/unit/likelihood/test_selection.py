"""Which terms are chosen by chi^2 and a price for each, on regressions whose terms are known."""

import numpy as np

from galloping.identification.selection import select


def chosen(columns, observed, penalty, start=None, sigma=1.0):
    """The terms of a regression with noise `sigma`, from the terms `start` on; None: from all."""
    information, right = columns.T @ columns / sigma**2, columns.T @ observed / sigma**2
    terms = np.arange(columns.shape[1])
    starts = [np.isin(terms, terms if start is None else start)]
    return terms[select(information, right, starts, penalty)].tolist()


def test_selection_does_not_depend_on_the_units_of_the_columns() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(400, 8))
    columns[:, 1:] += 0.8 * columns[:, :-1]
    observed = columns[:, [0, 2, 5]] @ [1.0, -2.0, 0.7] + rng.normal(size=400)
    assert chosen(10.0 ** np.arange(-8, 8, 2) * columns, observed, 12.0) == [0, 2, 5]


def test_two_terms_that_only_help_together_are_found() -> None:
    rng = np.random.default_rng(2)
    base = rng.normal(size=2000)
    columns = np.column_stack([base + 0.05 * rng.normal(size=2000), base])
    observed = 4.0 * (columns[:, 0] - columns[:, 1]) + 0.1 * rng.normal(size=2000)
    assert chosen(columns, observed, 15.0, start=[], sigma=0.1) == [0, 1]


def test_one_false_term_is_exchanged_for_two_true_ones() -> None:
    # the sum of two columns, with noise of its own, imitates both together
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(3000, 6))
    columns[:, 5] = columns[:, 0] + columns[:, 1] + 0.3 * rng.normal(size=3000)
    observed = columns[:, 0] + columns[:, 1] + 0.5 * columns[:, 3] + rng.normal(size=3000)
    for start in ([3, 5], None, []):
        assert chosen(columns, observed, 16.0, start) == [0, 1, 3]


def test_terms_that_imitate_each_other_keep_their_digits() -> None:
    # as from a long record: products with an inverse would lose all digits of chi^2 here
    rng = np.random.default_rng(6)
    base = rng.normal(size=4000)
    columns = np.column_stack([base + 1e-4 * rng.normal(size=4000) for _ in range(6)])
    observed = columns[:, :2] @ [3.0, -2.0] + 1e-6 * rng.normal(size=4000)
    assert chosen(columns, observed, 16.0, sigma=1e-6) == [0, 1]
