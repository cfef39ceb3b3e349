"""Flights that follow the gradient of what they bring."""

import dataclasses
from typing import Any

import pytest
import torch

from hyuav import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.ascent import Ascent
from hyuav.references.joint import Plan, SeveralHelpers
from hyuav.references.rewards import ExpectedReward


def scenario_of(**changes: Any) -> Scenario:
    return dataclasses.replace(Scenario.preset("two_eavesdroppers"), num_slots=16, **changes)


def beginnings(physics: Physics) -> list[Plan]:
    coarse = SeveralHelpers(physics, 50.0, 15.0, 1, seed=0)
    return list(coarse.straight(physics.scenario.num_slots))


@pytest.mark.parametrize("mode_rule", ["hybrid", "relay"])
@pytest.mark.parametrize("power_control", [False, True])
def test_each_flight_brings_at_least_what_it_did_and_the_best_one_more(
    mode_rule: str, power_control: bool
) -> None:
    scenario = scenario_of(power_control=power_control, fading=False)
    physics = Physics(scenario, dtype=torch.float64)
    told = ExpectedReward(physics, 1, torch.Generator().manual_seed(0))
    before = beginnings(physics)
    after = Ascent(physics, mode_rule, draws=1, seed=0).improved(before, steps=15)
    earned = [[told.of_flight(mode_rule, *plan) for plan in plans] for plans in (before, after)]
    assert all(late >= early - 1e-9 for early, late in zip(*earned, strict=True))
    assert max(earned[1]) > 1.01 * max(earned[0])


def test_flights_keep_to_the_limits_of_speed_map_energy_and_power() -> None:
    scenario = scenario_of(power_control=True, helper_energy_budget=900.0)
    physics = Physics(scenario, dtype=torch.float64)
    flights = Ascent(physics, "relay", draws=2, seed=0).improved(beginnings(physics), steps=5)
    limit = physics.norm_limit(["relay"])
    assert limit is not None
    starts = torch.tensor(scenario.helper_starts, dtype=torch.float64)
    for path, power in flights:
        speed = path.diff(dim=0) / scenario.slot_duration
        assert torch.equal(path[0], starts)
        assert bool((speed.abs() <= scenario.max_speed + 1e-9).all())
        assert bool((torch.linalg.vector_norm(speed, dim=-1) <= limit[0] + 1e-9).all())
        assert bool((path.abs() <= scenario.map_side / 2).all())
        assert bool((power <= 1.0).all())
        assert bool((10.0 * power.log10() >= -scenario.power_range - 1e-9).all())


def test_flights_climb_the_same_alone_and_side_by_side() -> None:
    physics = Physics(scenario_of(), dtype=torch.float64)
    both = beginnings(physics)[:2]
    ascent = Ascent(physics, "jamming", draws=2, seed=0)
    together = ascent.improved(both, steps=4)
    alone = [ascent.improved([plan], steps=4)[0] for plan in both]
    for one, other in zip(together, alone, strict=True):
        torch.testing.assert_close(one, other)


def test_a_flight_that_brings_nothing_anywhere_stays_as_it_is() -> None:
    scenario = scenario_of(min_secrecy_rate=100.0)
    physics = Physics(scenario, dtype=torch.float64)
    (before,) = beginnings(physics)[:1]
    ((path, power),) = Ascent(physics, "hybrid", draws=1, seed=0).improved([before], steps=3)
    torch.testing.assert_close((path, power), before)
