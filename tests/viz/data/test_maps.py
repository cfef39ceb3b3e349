import dataclasses

import numpy as np
import pytest

from hyuav import Scenario
from hyuav.viz.data.maps import helper_map


def test_rates_stand_at_the_position_of_their_row_and_column() -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), fading=False)
    rates = helper_map(scenario, 1.0)
    row, column = np.searchsorted(rates.axis, (6.0, -49.0))  # y, x
    assert rates.relay[row, column] == pytest.approx(2.391039, abs=1e-6)
    assert rates.rates("jamming")[-21, -21] == pytest.approx(2.714112, abs=1e-6)


def test_a_full_server_is_mapped_with_mean_tasks() -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), edge_energy_budget=5.0)
    free = helper_map(Scenario.preset("two_clusters"), 20.0)
    assert helper_map(scenario, 20.0).better.sum() < free.better.sum()
