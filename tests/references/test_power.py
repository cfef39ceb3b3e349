"""The helper's best power: published values."""

import dataclasses

import pytest
import torch

from hyuav import Scenario, make_env
from hyuav.physics.slot import Physics
from hyuav.references.optimum import solve_horizons
from hyuav.references.power import ROUGH_DRAWS, best_levels, levels_of
from hyuav.references.rewards import ExpectedReward

VALUES = {
    "random_disk": {
        "hybrid": (296.750, 760.290),
        "relay": (81.844, 174.695),
        "jamming": (290.735, 754.274),
    },
    "two_clusters": {
        "hybrid": (304.916, 776.483),
        "relay": (85.362, 183.931),
        "jamming": (299.371, 770.938),
    },
}


@pytest.mark.parametrize("name", VALUES)
def test_the_best_flights_whose_power_is_chosen_in_each_slot(name: str) -> None:
    scenario = dataclasses.replace(Scenario.preset(name), fading=False, power_control=True)
    found = solve_horizons(scenario, [10, 20], resolution=2.0)
    for mode_rule, expected in VALUES[name].items():
        optima = found[mode_rule]
        values = [optima[10].value, optima[20].value]
        assert values == pytest.approx(expected, rel=1e-3)
    best = found["hybrid"][20]
    nominal = torch.where(best.modes == 1, scenario.relay_power, scenario.jamming_power)
    torch.testing.assert_close(best.power, nominal * best.share)
    env = make_env(scenario, "hybrid", batch_size=())
    flown = env.rollout(20, best.policy)["next"]
    assert float(flown["episode_reward"][-1]) == pytest.approx(best.value, rel=1e-4)


def test_with_fading_the_chosen_power_earns_what_is_told() -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), power_control=True, num_slots=10
    )
    best = solve_horizons(scenario, [10], ["hybrid"], resolution=5.0, draws=32)["hybrid"][10]
    env = make_env(scenario, batch_size=(2000,), seed=1)
    flown = env.rollout(10, best.policy)["next"]
    returns = flown["episode_reward"][:, -1]
    error = float(returns.std()) / 2000**0.5 + best.standard_error
    assert abs(float(returns.mean()) - best.value) < 5 * error


@pytest.mark.parametrize("mode_rule", ["hybrid", "relay", "jamming"])
def test_with_fading_the_best_of_all_levels_is_found(mode_rule: str) -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), power_control=True)
    physics = Physics(scenario, dtype=torch.float64)
    rough, expected = (
        ExpectedReward(physics, draws, torch.Generator().manual_seed(0))
        for draws in (ROUGH_DRAWS, 128)
    )
    places = torch.tensor([[-20.0, 5.0], [-30.0, 15.0], [10.0, -20.0], [70.0, 75.0]])
    places = places.double().unsqueeze(1)
    power = places.new_ones(len(places), 1)
    found = best_levels(expected, rough, [mode_rule], places, power, 0, 1.0)[0][0]
    levels = levels_of(scenario, 1.0)
    tried = torch.stack([expected([mode_rule], places, power * level)[0] for level in levels])
    torch.testing.assert_close(found, tried.amax(dim=0), rtol=2e-2, atol=1e-6)
