import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from hyuav.viz.paper import COLORS, learning_curves, learning_table
from hyuav.viz.paper.curves import SMOOTHING

EPISODES = pd.RangeIndex(1, 101, name="episode")
RISING = pd.DataFrame({n: np.linspace(0, 40 + n, 100) for n in range(8)}, index=EPISODES)


def test_the_table_tells_the_interquartile_mean_of_the_smoothed_rewards() -> None:
    table = learning_table({"proposed": RISING}, {"proposed": 55.0}, "ddpg")
    last = table.iloc[-1]
    smooth = RISING.tail(SMOOTHING).mean().sort_values()
    assert last["iqm"] == pytest.approx(smooth.iloc[2:6].mean())
    assert smooth.iloc[0] <= last["low"] < last["iqm"] < last["high"] <= smooth.iloc[-1]
    assert (last["episode"], last["learners"], last["optimum"]) == (100, 8, 55.0)
    assert table["episode"].tolist() == EPISODES.tolist()


def test_one_learner_has_a_curve_without_a_band() -> None:
    table = learning_table({"re_ot": RISING[[0]]}, {})
    np.testing.assert_allclose(table["low"], table["high"])
    assert table["optimum"].isna().all()


def test_a_curve_has_its_schemes_color_and_its_optimum() -> None:
    rewards = {"proposed": RISING, "re_ot": RISING / 2}
    figure = learning_curves(learning_table(rewards, {"proposed": 55.0}))
    (axes,) = figure.axes
    curve = next(line for line in axes.lines if line.get_label() == "Proposed")
    assert to_hex(curve.get_color()) == COLORS["proposed"].lower()
    (optimum,) = [line for line in axes.lines if set(np.atleast_1d(line.get_ydata())) == {55.0}]
    assert to_hex(optimum.get_color()) == COLORS["proposed"].lower()
    assert figure.get_supylabel() == "Accumulated reward (bps/Hz)"


def test_each_training_has_a_panel_of_the_same_scale() -> None:
    tables = [learning_table({"ja_ot": RISING * k}, {}, f"by {k}") for k in (1, 2)]
    first, second = learning_curves(pd.concat(tables)).axes
    assert (first.get_title(), second.get_title()) == ("by 1", "by 2")
    assert first.get_ylim() == second.get_ylim()
