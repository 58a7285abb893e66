"""What the two-mode model is worth against a line with more modes."""

import numpy as np
import pytest

from galloping.evaluation import reduction as trial


@pytest.fixture
def short(monkeypatch):
    """The limit cycle is looked for earlier, for time."""
    monkeypatch.setattr(trial, "LIMIT_CYCLE", (250, 350))


def motion(case, variant):
    return trial.line_motion(case, variant, length_scale=100, spectrum="kaimal", seed=1)


def test_table_of_the_two_mode_model_and_lines(case, short):
    lines = {
        "3 modes": trial.LineVariant(3),
        "disturbed": trial.LineVariant(3, antisymmetric=0.1),
        "gusty": trial.LineVariant(3, intensity=0.05),
    }
    table = trial.reduction(case, {name: motion(case, line) for name, line in lines.items()})
    assert table.shape[0] == 8
    table = table.set_index(["line", "direction"])
    model = table.loc["two modes"]
    assert model["amplitude_m"].to_list() == pytest.approx([1.106, 1.873], abs=2e-3)
    assert model["r2_200_300_s"].to_list() == pytest.approx([1.0, 1.0])
    three = table.loc["3 modes"]
    assert three["amplitude_m"].to_list() == pytest.approx([1.177, 1.957], abs=2e-3)
    assert three["amplitude_error_percent"]["vertical"] == pytest.approx(
        100 * (1.106 / 1.177 - 1), abs=0.2
    )
    assert (three["r2_0_100_s"] > three["r2_200_300_s"]).all()
    assert (three["antisymmetric_m"] < 1e-9).all()
    assert table.loc[("disturbed", "vertical"), "antisymmetric_m"] > 0.1
    assert not np.allclose(table.loc["gusty", "amplitude_m"], three["amplitude_m"], rtol=1e-3)
