"""Functions that are named before they are imported."""

from operator import attrgetter

import pytest

from galloping import deferred


@pytest.mark.parametrize("name", ["table", "tables.score", "tables.scores.noise"])
def test_a_name_that_is_not_there_is_told(name):
    with pytest.raises(AttributeError, match=f"galloping.{name}: no such module or function"):
        attrgetter(name)(deferred)
