import numpy as np
import pandas as pd

from hyuav.experiments.families import distribution, fractions
from hyuav.viz.paper.families import families_figure

TABLE = pd.DataFrame(
    {
        "seed": range(6),
        "mode_rule": ["hybrid", "relay", "jamming"] * 2,
        "num_ues": [4, 6, 8, 10, 12, 14],
        "num_slots": [8, 12, 16, 20, 24, 28],
        "power_control": [False, True] * 3,
        "num_helpers": [1] * 6,
        "optimum": [10.0, 20.0, 40.0, 80.0, 0.5, 100.0],
        "generalist": [9.0, 20.0, 38.0, 80.0, 0.0, 95.0],
        "refined": [10.0, 20.0, 40.0, 80.0, 0.0, 99.0],
    }
)


def test_what_brings_next_to_nothing_is_left_out() -> None:
    own = fractions(TABLE)
    assert own["seed"].tolist() == [0, 1, 2, 3, 5]
    assert own["generalist_fraction"].tolist() == [0.9, 1.0, 0.95, 1.0, 0.95]


def test_fractions_are_told_of_all_and_by_a_column() -> None:
    own = fractions(TABLE)
    (whole,) = distribution(own).to_dict("records")
    assert whole["scenarios"] == 5
    assert np.isclose(whole["generalist_mean"], 0.96)
    assert whole["generalist_worst"] == 0.9
    by = distribution(own, "power_control")
    assert by["value"].tolist() == ["False", "True"]
    assert by["scenarios"].tolist() == [2, 3]
    assert distribution(own, "mode_rule")["scenarios"].sum() == 5


def test_the_figure_draws_every_scenario() -> None:
    left, right = families_figure(fractions(TABLE)).axes
    assert [np.size(line.get_xdata()) for line in left.lines] == [2, 2, 3, 3]
    assert sum(np.size(line.get_xdata()) for line in right.lines) == 5
