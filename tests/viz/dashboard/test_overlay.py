import dataclasses

import numpy as np
import pytest

from dashboard_runs import SCENARIO
from hyuav.physics.modes import MODE_RULES
from hyuav.viz.dashboard.overlay import (
    CLICK_TRACE,
    add_flights,
    explorer_map,
)
from hyuav.viz.data.flying import flown
from hyuav.viz.data.maps import RULE_MODES
from hyuav.viz.data.schemes import scheme_color


def test_moving_the_eavesdropper_changes_the_map() -> None:
    moved = dataclasses.replace(SCENARIO, eavesdropper_positions=((-50.0, 30.0),))
    before, after = (explorer_map(scenario, "hybrid", "rate") for scenario in (SCENARIO, moved))
    assert not np.array_equal(before.data[0].z, after.data[0].z)


@pytest.mark.parametrize("rule", MODE_RULES)
def test_the_map_shows_the_modes_that_may_be_chosen(rule: str) -> None:
    rates = explorer_map(SCENARIO, rule, "rate").data[0]
    other = {"relay": "jamming", "jamming": "relay", "hybrid": "relay"}[rule]
    assert set(RULE_MODES) == set(MODE_RULES)
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
