import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
import torch

from hyuav import InputError, InputTypeError, Scenario, make_env
from hyuav.physics.energy import budget_speeds
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.outcome import Control
from hyuav.physics.slot import Physics, slot
from hyuav.references.flight import FlightPolicy, flyable
from hyuav.references.optimum import RESOLUTION, Optimum, solve_horizons, solve_optimum

REFERENCE = {
    "random_disk": {20: (60.183, 38.107, 56.905)},
    "two_clusters": {10: (20.842, 20.842, 16.318), 20: (59.080, 44.762, 56.663)},
}

WITH_FADING = {
    "random_disk": {10: (20.3961, 17.4378, 16.3201), 20: (61.0166, 35.7993, 56.9283)},
    "two_clusters": {10: (19.9985, 19.9982, 16.2615), 20: (59.8561, 42.9732, 56.6992)},
}
"""Likewise, averaged over the default draws on a grid of 4 m, as in the first version."""


def without_fading(name: str = "two_clusters", **changes: Any) -> Scenario:
    return dataclasses.replace(Scenario.preset(name), fading=False, **changes)


def few_flights(**changes: Any) -> Scenario:
    """So few slots, from a start between both modes' regions, that every flight can be tried."""
    return without_fading(helper_starts=(30.0, 30.0), num_slots=3, **changes)


def flown_return(optimum: Optimum, episodes: int) -> torch.Tensor:
    env = make_env(optimum.scenario, optimum.mode_rule, batch_size=episodes, seed=5)
    policy = optimum.policy
    flight = env.rollout(optimum.scenario.num_slots, policy)
    return flight["next", "reward"].sum(dim=(-1, -2))


@pytest.mark.parametrize("name", REFERENCE)
def test_reaches_the_values_of_the_specification(name: str) -> None:
    expected = REFERENCE[name]
    found = solve_horizons(without_fading(name), list(expected), resolution=1.0)
    for horizon, values in expected.items():
        optima = [found[scheme][horizon].value for scheme in MODE_RULES]
        assert optima == pytest.approx(values, rel=1e-4)


@pytest.mark.parametrize("name", WITH_FADING)
def test_averages_over_the_fading_as_it_did_in_the_first_version(name: str) -> None:
    expected = WITH_FADING[name]
    found = solve_horizons(Scenario.preset(name), list(expected), resolution=4.0)
    for horizon, values in expected.items():
        optima = [found[scheme][horizon].value for scheme in MODE_RULES]
        assert optima == pytest.approx(values, abs=1e-3)


@pytest.mark.parametrize("name", REFERENCE)
def test_the_best_hybrid_relays_early_and_jams_late(name: str) -> None:
    modes = solve_optimum(without_fading(name), ["hybrid"], resolution=1.0)["hybrid"].modes
    assert modes[:4].any()
    assert not modes[4:].any()


def test_the_power_is_the_nominal_one_of_the_mode() -> None:
    optimum = solve_optimum(without_fading(), ["hybrid"], resolution=4.0)["hybrid"]
    relays = optimum.modes == 1
    assert optimum.power.shape == optimum.modes.shape == (20, 1)
    assert optimum.power[relays].tolist() == [0.012] * int(relays.sum())
    assert optimum.power[~relays].tolist() == [0.08] * int((~relays).sum())
    assert optimum.upper_bound is None


def test_fixed_mode_rules_keep_their_mode() -> None:
    optima = solve_optimum(without_fading(), resolution=4.0)
    assert optima["relay"].modes.tolist() == [[1]] * 20
    assert optima["jamming"].modes.tolist() == [[0]] * 20


def brute_force(scenario: Scenario, scheme: str, resolution: float) -> float:
    """The best return over all flights, one by one."""
    physics = Physics(scenario, dtype=torch.float64)
    half = scenario.map_side / 2
    count = int(scenario.map_side / resolution)
    axis = [scenario.helper_starts[0][0] + resolution * k for k in range(-count, count + 1)]
    points = list(itertools.product([x for x in axis if abs(x) <= half], repeat=2))
    helper = torch.tensor(points, dtype=torch.float64).unsqueeze(-2)
    hovering = Control(torch.zeros_like(helper))
    slots = slot(physics, physics.nodes._replace(helper=helper), hovering)
    relay, jamming = slots.relay.sum_rate, slots.jamming.sum_rate
    rewards = {"relay": relay, "jamming": jamming, "hybrid": torch.maximum(relay, jamming)}
    reward = dict(zip(points, rewards[scheme].tolist(), strict=True))
    norm = budget_speeds(scenario, scheme)[0]
    if scenario.speed_limit == "disc":
        norm = min(norm, scenario.max_speed)

    def reachable(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
        step = abs(a[0] - b[0]), abs(a[1] - b[1])
        return max(step) <= scenario.max_speed and math.hypot(*step) <= norm

    nearby = {a: [b for b in points if reachable(a, b)] for a in points}

    def best(point: tuple[float, ...], slots: int) -> float:
        if slots == 0:
            return 0.0
        return max(reward[after] + best(after, slots - 1) for after in nearby[point])

    return best(scenario.helper_starts[0], scenario.num_slots)


@pytest.mark.parametrize("scheme", MODE_RULES)
@pytest.mark.parametrize("limits", [{}, {"speed_limit": "disc"}, {"helper_energy_budget": 1500.0}])
def test_no_flight_of_a_small_instance_is_better(scheme: str, limits: dict[str, Any]) -> None:
    scenario = few_flights(**limits)
    optimum = solve_optimum(scenario, [scheme], resolution=10.0)[scheme]
    assert optimum.value > 0.1
    assert optimum.value == pytest.approx(brute_force(scenario, scheme, 10.0), rel=1e-4)


def test_a_longer_horizon_is_never_worse() -> None:
    found = solve_horizons(without_fading(), range(1, 21), resolution=4.0)
    for optima in found.values():
        values = [optimum.value for optimum in optima.values()]
        assert all(a <= b + 1e-4 for a, b in itertools.pairwise(values))


def test_each_horizon_has_the_value_of_its_own_problem() -> None:
    scenario = without_fading()
    together = solve_horizons(scenario, [10, 15], ["hybrid"], resolution=4.0)["hybrid"]
    for horizon, optimum in together.items():
        alone = dataclasses.replace(scenario, num_slots=horizon)
        assert optimum.scenario == alone
        assert optimum.value == solve_optimum(alone, ["hybrid"], resolution=4.0)["hybrid"].value


@pytest.mark.parametrize("name", REFERENCE)
def test_a_finer_nested_grid_is_never_worse(name: str) -> None:
    values = [
        [optimum.value for optimum in solve_optimum(without_fading(name), resolution=r).values()]
        for r in (8.0, 4.0, 2.0, 1.0)
    ]
    for coarse, fine in itertools.pairwise(values):
        assert all(a <= b * (1 + 1e-5) for a, b in zip(coarse, fine, strict=True))


@pytest.mark.parametrize("fading", [True, False])
def test_the_hybrid_is_at_least_as_good_as_either_mode(fading: bool) -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), fading=fading)
    for horizon in (10, 20):
        found = solve_horizons(scenario, [horizon], resolution=4.0, evaluation_draws=2000)
        values = {scheme: optima[horizon] for scheme, optima in found.items()}
        slack = 1e-4 + 2 * values["hybrid"].standard_error
        for scheme in ("relay", "jamming"):
            assert values["hybrid"].value >= values[scheme].value - slack


@pytest.mark.parametrize(
    ("limits", "norm"),
    [
        ({}, math.sqrt(800.0)),
        ({"speed_limit": "disc"}, 20.0),
        ({"helper_energy_budget": 3000.0}, math.sqrt(2 * 3000.0 / 9.65)),
        ({"speed_limit": "disc", "helper_energy_budget": 800.0}, math.sqrt(2 * 800.0 / 9.65)),
    ],
)
def test_the_flight_keeps_the_speed_limit_and_the_energy_budget(
    limits: dict[str, Any], norm: float
) -> None:
    for optimum in solve_optimum(without_fading(**limits), resolution=2.0).values():
        steps = optimum.path.diff(dim=0)
        assert steps.abs().max() <= 20.0 + 1e-6
        fastest = float(torch.linalg.vector_norm(steps, dim=-1).max())
        assert norm - 3.0 <= fastest <= norm + 1e-6
        assert optimum.path.abs().max() <= 100.0


def test_a_helper_without_energy_to_fly_stays() -> None:
    scenario = without_fading(helper_energy_budget=0.0)
    path = solve_optimum(scenario, ["hybrid"], resolution=4.0)["hybrid"].path
    assert (path - path[0]).abs().max() == 0.0


@pytest.mark.parametrize("name", REFERENCE)
@pytest.mark.parametrize(
    ("resolution", "speed_limit"), [(2.0, "box"), (1.0, "box"), (0.7, "box"), (2.0, "disc")]
)
def test_flown_without_fading_it_earns_its_value(
    name: str, resolution: float, speed_limit: str
) -> None:
    scenario = without_fading(name, speed_limit=speed_limit)
    for optima in solve_horizons(scenario, [10, 20], resolution=resolution).values():
        for optimum in optima.values():
            assert optimum.standard_error == 0.0
            assert float(flown_return(optimum, 1)) == pytest.approx(optimum.value, rel=1e-4)


def test_a_position_on_the_edge_of_coverage_or_map_is_flown_just_inside() -> None:
    radius, corner = 30.1, (50.0, 50.0)
    scenario = few_flights(
        coverage_radius=radius,
        map_side=100.0,
        ue_positions=((0.3, 0.7),),
        eavesdropper_positions=(40.0, 40.0),
    )
    edge = (0.3 + radius * 0.6, 0.7 + radius * 0.8)
    path = torch.tensor([[(10.0, 20.0)], [edge], [(35.0, 40.0)], [corner]], dtype=torch.float64)
    flown = flyable(path, Physics(scenario, dtype=torch.float64), "hybrid")
    assert (flown - path).abs().max() < 2e-4
    assert torch.dist(flown[1, 0], torch.tensor([0.3, 0.7], dtype=torch.float64)) < radius - 1e-5
    assert flown[3].max() < 50.0 - 1e-5
    assert torch.equal(flown[[0, 2]], path[[0, 2]])


@pytest.mark.parametrize("scheme", MODE_RULES)
def test_flown_with_fading_it_earns_its_value(scheme: str) -> None:
    optimum = solve_optimum("two_clusters", [scheme], resolution=4.0, evaluation_draws=4000)[scheme]
    returns = flown_return(optimum, 2000)
    error = math.hypot(float(returns.std()) / math.sqrt(2000), optimum.standard_error)
    assert abs(float(returns.mean()) - optimum.value) < 4 * error


def test_random_flights_never_beat_it() -> None:
    scenario = without_fading()
    optimum = solve_optimum(scenario, ["hybrid"], resolution=1.0)["hybrid"]
    torch.manual_seed(0)
    flights = make_env(scenario, "hybrid", batch_size=2000, seed=0).rollout(20)
    assert flights["next", "reward"].sum(dim=(-1, -2)).max() < optimum.value


def test_a_saturated_edge_server_lowers_the_value() -> None:
    free = few_flights()
    busy = dataclasses.replace(free, edge_energy_budget=0.5)
    assert Physics(busy).edge_can_saturate
    settings: dict[str, Any] = {"resolution": 10.0, "draws": 64, "evaluation_draws": 2000}
    saturated = solve_optimum(busy, ["hybrid"], **settings)["hybrid"]
    assert 0.0 < saturated.value < solve_optimum(free, ["hybrid"], **settings)["hybrid"].value
    assert saturated.standard_error > 0.0
    returns = flown_return(saturated, 2000)
    error = math.hypot(float(returns.std()) / math.sqrt(2000), saturated.standard_error)
    assert abs(float(returns.mean()) - saturated.value) < 4 * error


def test_the_seed_makes_it_reproducible() -> None:
    first, second = (
        solve_optimum(
            "two_clusters", ["hybrid"], resolution=8.0, draws=16, evaluation_draws=100, seed=3
        )
        for _ in range(2)
    )
    assert first["hybrid"].value == second["hybrid"].value
    assert torch.equal(first["hybrid"].path, second["hybrid"].path)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_the_policy_flies_any_batch_along_the_path(batch: tuple[int, ...]) -> None:
    optimum = solve_optimum(without_fading(), ["relay"], resolution=4.0)["relay"]
    env = make_env(optimum.scenario, "relay", batch_size=batch)
    flight = env.rollout(20, optimum.policy)
    assert flight["action"].shape == (*batch, 20, 2)
    flown = flight["next", "position"].double()
    assert (flown - optimum.path[1:]).abs().max() < 2e-5


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": -1.0}, "resolution"),
        ({"resolution": math.nan}, "resolution"),
        ({"resolution": math.inf}, "resolution"),
        ({"resolution": 1e-3}, "resolution"),
        ({"resolution": "fine"}, "resolution"),
        ({"mode_rules": ["relays"]}, "mode_rules"),
        ({"mode_rules": "hybird"}, "mode_rules"),
        ({"draws": 1}, "draws"),
        ({"draws": 2.5}, "draws"),
        ({"evaluation_draws": 0}, "evaluation_draws"),
        ({"seed": -1}, "seed"),
        ({"scenario": "one_cluster"}, "scenario"),
    ],
)
def test_bad_input_is_answered_in_one_line(arguments: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field) as caught:
        solve_optimum(**{"scenario": "two_clusters", **arguments})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("horizons", [[], [0], [2.5], 10])
def test_horizons_are_whole_numbers_of_slots(horizons: Any) -> None:
    with pytest.raises(InputError):
        solve_horizons("two_clusters", horizons)


@pytest.mark.parametrize("name", ["random_disk", "two_clusters"])
@pytest.mark.parametrize("fading", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_halving_the_default_resolution_moves_no_value_by_two_parts_in_a_thousand(
    name: str, fading: bool
) -> None:
    scenario = dataclasses.replace(Scenario.preset(name), fading=fading)
    coarse, fine = (
        solve_horizons(scenario, [10, 20], resolution=resolution)
        for resolution in (RESOLUTION, RESOLUTION / 2)
    )
    for scheme, optima in coarse.items():
        for horizon, optimum in optima.items():
            assert fine[scheme][horizon].value == pytest.approx(optimum.value, rel=0.002)


@pytest.mark.parametrize("mode_rules", [3, None, {"hybrid"}, []])
def test_mode_rules_are_a_name_or_a_list_of_names(mode_rules: Any) -> None:
    with pytest.raises(InputError, match=r"^mode_rules[^\n]*expected[^\n]*hybrid"):
        solve_optimum(without_fading(), mode_rules, resolution=10.0)


def test_numbers_and_paths_of_any_kind_are_taken() -> None:
    few: dict[str, Any] = {
        "draws": np.int64(2),
        "evaluation_draws": torch.tensor(2),
        "seed": np.uint8(3),
    }
    resolutions: list[Any] = [np.float32(20.0), torch.tensor(20), np.int64(20)]
    rules: Any = np.array(["relay"])
    for resolution in resolutions:
        found = solve_optimum("two_clusters", rules, resolution=resolution, **few)
        assert found["relay"].resolution == 20
    path = found["relay"].path
    for given in (path.numpy(), path.tolist()):
        assert torch.equal(FlightPolicy(given, "two_clusters").path, path)
    with pytest.raises(InputTypeError, match=r"path = 'x': expected positions in m of shape"):
        FlightPolicy("x", "two_clusters")
    with pytest.raises(InputError, match=r"path = \(20, 2\): expected .* shape \(T \+ 1, 1, 2\)"):
        FlightPolicy(np.zeros((20, 2)), "two_clusters")
