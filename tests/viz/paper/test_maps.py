import dataclasses

import numpy as np
import pytest

from hyuav import Scenario
from hyuav.viz.data.maps import helper_map
from hyuav.viz.paper.maps import sum_rate_maps

SCENARIO = Scenario.preset("two_clusters")


def test_the_maps_show_the_secrecy_sum_rate_in_each_mode_and_the_better() -> None:
    table = helper_map(SCENARIO, resolution=20.0).table()
    at = table.set_index(["x", "y"])
    assert at.loc[(-20.0, -20.0), "relay"] == pytest.approx(1.713314, rel=1e-5)
    assert at.loc[(80.0, 80.0), "jamming"] == pytest.approx(2.714112, rel=1e-5)
    figure = sum_rate_maps(SCENARIO, table)
    images = [np.asarray(axes.images[0].get_array()) for axes in figure.axes[:4]]
    relay, jamming, better, chosen = images
    assert relay[4, 4] == at.loc[(-20.0, -20.0), "relay"]
    assert jamming[2, 9] == at.loc[(80.0, -60.0), "jamming"]  # rows are y, columns are x
    assert np.array_equal(better, np.maximum(relay, jamming))
    assert np.array_equal(chosen == 0, better == 0)
    assert np.array_equal(chosen == 2, relay > jamming)


def test_the_maps_can_be_drawn_where_the_edge_server_fills_up() -> None:
    crowded = dataclasses.replace(SCENARIO, edge_energy_budget=1.0)
    free, full = (helper_map(scenario, 20.0).rates["better"] for scenario in (SCENARIO, crowded))
    assert 0 < full.max() < free.max()
