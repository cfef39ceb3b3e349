"""The flights of several helpers: published values, and what their flights really earn."""

import dataclasses
from functools import partial

import pytest
import torch

from hyuav import Scenario, make_env, solve_optimum
from hyuav.physics.slot import Physics
from hyuav.references.joint import SeveralHelpers

TWO = ((80.0, 80.0), (-80.0, 60.0))
APART = ((-60.0, -60.0), (60.0, -60.0))


def scenario_of(name: str, starts: object, eavesdroppers: object, num_slots: int) -> Scenario:
    return dataclasses.replace(
        Scenario.preset(name),
        fading=False,
        helper_starts=starts,  # type: ignore[arg-type]
        eavesdropper_positions=eavesdroppers,  # type: ignore[arg-type]
        num_slots=num_slots,
    )


@pytest.mark.parametrize(
    ("name", "starts", "eavesdroppers", "values"),
    [
        (
            "random_disk",
            ((-60.0, -60.0),) * 2,
            ((80.0, 80.0),),
            {"hybrid": (25.437, 65.959), "relay": (21.005, 43.262), "jamming": (8.982, 30.016)},
        ),
        (
            "two_clusters",
            APART,
            TWO,
            {"hybrid": (13.450, 35.101), "relay": (9.287, 18.848), "jamming": (10.138, 29.900)},
        ),
    ],
)
def test_the_joint_program_on_a_grid_of_ten_metres(
    name: str, starts: object, eavesdroppers: object, values: dict[str, tuple[float, float]]
) -> None:
    for index, num_slots in enumerate((10, 20)):
        scenario = scenario_of(name, starts, eavesdroppers, num_slots)
        planner = SeveralHelpers(Physics(scenario, dtype=torch.float64), 10.0, 1.0, 2, seed=0)
        for mode_rule, expected in values.items():
            plan = planner._joint_plan(mode_rule, num_slots)
            found = planner._quiet.of_flight(mode_rule, *plan)
            assert found == pytest.approx(expected[index], rel=1e-3)


def test_what_is_found_is_between_the_coarse_program_and_the_bound_and_can_be_flown() -> None:
    scenario = scenario_of("two_clusters", APART, TWO, 20)
    optimum = solve_optimum(scenario, ["hybrid"])["hybrid"]
    assert optimum.upper_bound is not None
    assert 35.101 < optimum.value < optimum.upper_bound < 1.1 * optimum.value
    assert optimum.path.shape == (21, 2, 2)
    assert optimum.modes.shape == optimum.power.shape == (20, 2)
    env = make_env(scenario, batch_size=())
    flown = env.rollout(20, optimum.policy)["next"]
    assert float(flown["episode_reward"][-1]) == pytest.approx(optimum.value, rel=1e-4)
    assert torch.equal(flown["mode"], optimum.modes)


def test_two_helpers_whose_power_is_chosen_earn_more_and_fly_at_it() -> None:
    scenario = dataclasses.replace(
        scenario_of("two_clusters", APART, TWO, 2), power_control=True, power_range=30.0
    )
    fixed = dataclasses.replace(scenario, power_control=False)
    solve = partial(solve_optimum, mode_rules=["hybrid"], resolution=5.0, certify=False)
    chosen = solve(scenario, power_step=5.0)["hybrid"]
    assert chosen.value > solve(fixed)["hybrid"].value
    flown = make_env(scenario, batch_size=()).rollout(2, chosen.policy)["next"]
    assert float(flown["episode_reward"][-1]) == pytest.approx(chosen.value, rel=1e-4)


def test_three_helpers_fly_what_is_found_below_the_bound() -> None:
    two = scenario_of("two_clusters", APART, TWO, 3)
    three = dataclasses.replace(two, helper_starts=(*APART, (-60.0, -60.0)))
    found = solve_optimum(three, ["hybrid"], resolution=5.0)["hybrid"]
    assert found.upper_bound is not None
    assert found.path.shape == (4, 3, 2)
    assert 0.0 <= found.value < found.upper_bound
    env = make_env(three, batch_size=())
    flown = env.rollout(3, found.policy)["next"]
    assert float(flown["episode_reward"][-1]) == pytest.approx(found.value, rel=1e-4)
