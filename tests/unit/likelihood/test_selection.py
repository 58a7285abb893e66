import numpy as np

from galloping.identification.likelihood.selection import select


def regression(seed: int, true: np.ndarray, rows: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of a regression with unit noise on correlated columns."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(rows, len(true)))
    columns[:, 1:] += 0.8 * columns[:, :-1]
    observed = columns @ true + rng.normal(size=rows)
    return columns.T @ columns, columns.T @ observed


TRUE = np.array([1.0, 0.0, -2.0, 0.0, 0.0, 0.7, 0.0, 0.0])


def test_selection_does_not_depend_on_the_units_of_the_columns() -> None:
    information, right = regression(1, TRUE)
    units = 10.0 ** np.arange(-8, 8, 2)
    scaled = information * units[:, None] * units
    support = select(scaled, right * units, [np.ones(8, bool)], 12.0)
    assert support.tolist() == (TRUE != 0.0).tolist()


def test_two_terms_that_only_help_together_are_found() -> None:
    rng = np.random.default_rng(2)
    base = rng.normal(size=2000)
    columns = np.column_stack([base + 0.05 * rng.normal(size=2000), base])
    observed = 4.0 * (columns[:, 0] - columns[:, 1]) + 0.1 * rng.normal(size=2000)
    information, right = columns.T @ columns / 0.01, columns.T @ observed / 0.01
    assert select(information, right, [np.zeros(2, bool)], 15.0).all()


def test_one_false_term_is_exchanged_for_two_true_ones() -> None:
    # the sum of two columns, with noise of its own, imitates both together
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(3000, 6))
    columns[:, 5] = columns[:, 0] + columns[:, 1] + 0.3 * rng.normal(size=3000)
    observed = columns[:, 0] + columns[:, 1] + 0.5 * columns[:, 3] + rng.normal(size=3000)
    information, right = columns.T @ columns, columns.T @ observed
    for start in ([3, 5], [0, 1, 2, 3, 4, 5], []):
        support = select(information, right, [np.isin(np.arange(6), start)], 16.0)
        assert np.flatnonzero(support).tolist() == [0, 1, 3]


def test_terms_that_imitate_each_other_keep_their_digits() -> None:
    # as from a long record: products with an inverse would lose all digits of chi^2 here
    rng = np.random.default_rng(6)
    base = rng.normal(size=4000)
    columns = np.column_stack([base + 1e-4 * rng.normal(size=4000) for _ in range(6)])
    observed = 3.0 * columns[:, 0] - 2.0 * columns[:, 1]
    sigma = 1e-6
    observed = observed + sigma * rng.normal(size=4000)
    information, right = columns.T @ columns / sigma**2, columns.T @ observed / sigma**2
    assert np.flatnonzero(select(information, right, [np.ones(6, bool)], 16.0)).tolist() == [0, 1]
