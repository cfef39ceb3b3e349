import dataclasses

import numpy as np
import pytest
import torch

from dashboard_runs import SCENARIO
from hyuav import Scenario
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import mean_tasks
from hyuav.viz.data.maps import RULE_MODES, helper_map
from reference import hover


def test_rates_stand_at_the_position_of_their_row_and_column() -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), fading=False)
    rates = helper_map(scenario, 1.0)
    row, column = np.searchsorted(rates.axis, (6.0, -49.0))  # y, x
    assert rates.rates["relay"][row, column] == pytest.approx(2.391039, abs=1e-6)
    assert rates.rates["jamming"][-21, -21] == pytest.approx(2.714112, abs=1e-6)


def test_what_comes_without_a_helper_stands_beside_the_map() -> None:
    brings = helper_map(Scenario.preset("two_clusters"), 50.0)
    assert brings.without_helper == pytest.approx(19.4288, abs=1e-4)
    assert set(brings.table()["no_helper"]) == {brings.without_helper}


def test_a_full_server_is_mapped_with_mean_tasks() -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), edge_energy_budget=5.0)
    free = helper_map(Scenario.preset("two_clusters"), 20.0)
    assert helper_map(scenario, 20.0).rates["better"].sum() < free.rates["better"].sum()


@pytest.mark.parametrize("crowded", [False, True])
def test_the_counts_are_of_the_ues_that_offload_there(crowded: bool) -> None:
    budget = 1.0 if crowded else SCENARIO.edge_energy_budget
    scenario = dataclasses.replace(SCENARIO, edge_energy_budget=budget)
    physics, tasks = Physics(scenario, dtype=torch.float64), mean_tasks(scenario, torch.float64)
    for x, y in ((-20.0, -20.0), (80.0, 60.0), (-40.0, 20.0), (0.0, 0.0)):
        at = int((y + 100) / 20), int((x + 100) / 20)
        slot = hover(physics, [x, y], tasks=tasks)
        relay, jamming = slot.relay, slot.jamming
        better = relay if relay.sum_rate > jamming.sum_rate else jamming
        for rule, outcome in zip(MODE_RULES, (better, relay, jamming), strict=True):
            expected = int(outcome.offloading.sum())
            counts = helper_map(scenario, 20.0).offloading[RULE_MODES[rule]]
            assert counts[at] == expected
