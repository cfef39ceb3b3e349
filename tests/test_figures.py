import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import imread

from hyuav import Scenario
from hyuav.evaluation import EvaluationParameters, Policy, evaluate
from hyuav.figures import (
    COLORS,
    FLIGHT_PANELS,
    flight_map,
    learning_curves,
    save_figure,
    sum_rate_maps,
)
from hyuav.schemes.linear import ja_lt, re_lt

SCENARIO = Scenario.preset("two_clusters")


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_a_learning_curve_has_its_schemes_color_and_its_optimum() -> None:
    rewards = pd.DataFrame({0: np.linspace(0, 40, 100), 1: np.linspace(0, 50, 100)})
    figure = learning_curves({"proposed": rewards, "re_ot": rewards / 2}, {"proposed": 55.0})
    (axes,) = figure.axes
    curve = next(line for line in axes.lines if line.get_label() == "Proposed")
    assert to_hex(curve.get_color()) == COLORS["proposed"].lower()
    assert np.asarray(curve.get_ydata())[-1] == pytest.approx(45, abs=6)
    assert any(set(np.atleast_1d(line.get_ydata())) == {55.0} for line in axes.lines)
    assert axes.get_ylabel() == "Accumulated reward (bps/Hz)"


def test_the_flight_map_shows_every_scheme_that_was_flown() -> None:
    policies = {"re_lt": [Policy(re_lt(SCENARIO))], "ja_lt": [Policy(ja_lt(SCENARIO))]}
    flown = evaluate(SCENARIO, "x", policies, EvaluationParameters(episodes=2, flights=1))
    figure = flight_map(SCENARIO, flown.flights)
    assert len(figure.axes) == len(FLIGHT_PANELS)
    assert {"Re-LT", "Ja-LT", "UE", "helper relays", "helper jams"} <= set(texts(figure))
    assert "Proposed" not in texts(figure)


def test_the_maps_show_the_secrecy_sum_rate_in_each_mode_and_the_better() -> None:
    figure = sum_rate_maps(SCENARIO, resolution=20.0)
    relay, jamming, better = (np.asarray(axes.images[0].get_array()) for axes in figure.axes[:3])
    assert relay[4, 4] == pytest.approx(1.713314, rel=1e-5)  # at (-20, -20)
    assert jamming[9, 9] == pytest.approx(2.714112, rel=1e-5)  # at (80, 80)
    assert np.array_equal(better, np.maximum(relay, jamming))


def test_the_maps_can_be_drawn_where_the_edge_server_fills_up() -> None:
    crowded = dataclasses.replace(SCENARIO, edge_energy_budget=1.0)
    free, full = (sum_rate_maps(scenario, 20.0) for scenario in (SCENARIO, crowded))
    most = [np.asarray(figure.axes[2].images[0].get_array()).max() for figure in (free, full)]
    assert 0 < most[1] < most[0]


def test_a_figure_is_saved_as_png_and_pdf_at_the_width_of_a_column(tmp_path: Path) -> None:
    rewards = pd.DataFrame({0: np.linspace(0, 40, 100)})
    save_figure(learning_curves({"ja_ot": rewards}, {}), tmp_path / "new", "curves")
    assert imread(tmp_path / "new" / "curves.png").shape[1] == pytest.approx(3.5 * 300, abs=1)
    assert (tmp_path / "new" / "curves.pdf").read_bytes().startswith(b"%PDF")
