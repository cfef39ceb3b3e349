import dataclasses

import numpy as np
import pytest
import torch

from dashboard_runs import SCENARIO
from hyuav.physics.offloading import MODE_RULES
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import mean_tasks
from hyuav.viz.dashboard.flying import flown
from hyuav.viz.dashboard.overlay import (
    CLICK_TRACE,
    MODES,
    add_flights,
    explorer_map,
    offloading_counts,
)
from hyuav.viz.html.style import scheme_color
from reference import hover


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
            assert offloading_counts(scenario, rule, 20.0)[at] == expected


def test_moving_the_eavesdropper_changes_the_map() -> None:
    moved = dataclasses.replace(SCENARIO, eavesdropper_positions=(-50.0, 30.0))
    before, after = (explorer_map(scenario, "hybrid", "rate") for scenario in (SCENARIO, moved))
    assert not np.array_equal(before.data[0].z, after.data[0].z)


@pytest.mark.parametrize("rule", MODE_RULES)
def test_the_map_shows_the_modes_that_may_be_chosen(rule: str) -> None:
    rates = explorer_map(SCENARIO, rule, "rate").data[0]
    other = {"relay": "jamming", "jamming": "relay", "hybrid": "relay"}[rule]
    assert set(MODES) == set(MODE_RULES)
    assert np.asarray(rates.z).max() > 0
    assert not np.array_equal(rates.z, explorer_map(SCENARIO, other, "rate").data[0].z)


def test_flights_lie_over_the_map_and_below_the_nodes() -> None:
    figure = explorer_map(SCENARIO, "hybrid", "coverage")
    add_flights(figure, SCENARIO, flown(SCENARIO, "hybrid").flights)
    names = [trace.name for trace in figure.data]
    pieces = [trace for trace in figure.data if trace.name == "Optimum"]
    assert {trace.line.color for trace in pieces} == {scheme_color("optimum")}
    assert {trace.line.dash == "solid" for trace in pieces} == {True, False}
    assert (pieces[0].x[0], pieces[0].y[0]) == SCENARIO.helper_starts[0]
    assert names.index("Optimum") < names.index("eavesdropper (E)")
    assert names[-1] == CLICK_TRACE
