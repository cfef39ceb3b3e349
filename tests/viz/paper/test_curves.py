from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from hyuav.viz.data.curves import LearningCurve, learning_table
from hyuav.viz.data.schemes import COLORS
from hyuav.viz.paper.curves import learning_figure

EPISODES = pd.RangeIndex(1, 101, name="episode")
RISING = pd.DataFrame({n: np.linspace(0, 40 + n, 100) for n in range(8)}, index=EPISODES)


def table(
    rewards: Mapping[str, pd.DataFrame], optima: Mapping[str, float], training: str = ""
) -> pd.DataFrame:
    curves = [LearningCurve(scheme, 20, 1.0, own) for scheme, own in rewards.items()]
    return learning_table(curves, optima, training)


def test_a_curve_has_its_schemes_color_and_its_optimum() -> None:
    figure = learning_figure(table({"proposed": RISING, "re_ot": RISING / 2}, {"hybrid": 55.0}))
    (axes,) = figure.axes
    curve = next(line for line in axes.lines if line.get_label() == "Proposed")
    assert to_hex(curve.get_color()) == COLORS["proposed"].lower()
    (optimum,) = [line for line in axes.lines if set(np.atleast_1d(line.get_ydata())) == {55.0}]
    assert to_hex(optimum.get_color()) == COLORS["proposed"].lower()
    assert figure.get_supylabel() == "Accumulated reward (bps/Hz)"


def test_each_training_has_a_panel_of_the_same_scale() -> None:
    tables = [table({"ja_ot": RISING * k}, {}, f"by {k}") for k in (1, 2)]
    first, second = learning_figure(pd.concat(tables)).axes
    assert (first.get_title(), second.get_title()) == ("by 1", "by 2")
    assert first.get_ylim() == second.get_ylim()


@pytest.mark.parametrize(("alone", "drawn"), [(388.6, False), (50.0, True)])
def test_what_comes_without_a_helper_is_a_number_where_a_line_would_squash_the_curves(
    alone: float, drawn: bool
) -> None:
    curves = table({"proposed": RISING}, {"hybrid": 55.0})
    curves.attrs["no_helper"] = alone
    figure = learning_figure(curves)
    (axes,) = figure.axes
    lines = [line for line in axes.lines if set(np.atleast_1d(line.get_ydata())) == {alone}]
    assert bool(lines) == drawn
    (legend,) = figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert ("No helper" if drawn else "No helper: 388.6") in texts
    assert axes.get_ylim()[1] < 70
