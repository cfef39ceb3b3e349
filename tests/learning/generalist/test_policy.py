"""The generalist flies what it plans, in environments of one helper and of several."""

import dataclasses

import pytest
import torch

from hyuav import Scenario, family, make_env, pretrained
from hyuav.learning.generalist.plans import roughly_best
from hyuav.learning.generalist.policy import GeneralistPolicy
from hyuav.learning.generalist.refine import refined
from hyuav.physics.slot import Physics
from hyuav.references.optimum import solve_optimum
from hyuav.references.rewards import ExpectedReward, estimate_return


def short(name: str, seed: int) -> Scenario:
    return dataclasses.replace(family(name, seed).scenario, num_slots=6, fading=False)


def policy_of(scenario: Scenario, mode_rule: str = "hybrid") -> GeneralistPolicy:
    return pretrained("generalist").policy(scenario, mode_rule)


CASES = {
    "one": short("one", 1),
    "power": dataclasses.replace(short("one", 2), power_control=True),
    "disc": dataclasses.replace(short("one", 3), speed_limit="disc"),
    "two": dataclasses.replace(short("two", 1), power_control=False),
    "two, power": dataclasses.replace(short("two", 2), power_control=True),
}


@pytest.mark.parametrize("scenario", CASES.values(), ids=CASES)
def test_what_is_planned_is_flown_and_earned(scenario: Scenario) -> None:
    policy = policy_of(scenario)
    plan = policy.plan()
    flown = make_env(scenario, batch_size=(3,), seed=0).rollout(scenario.num_slots, policy)
    torch.testing.assert_close(
        flown["next", "position"], plan.path[1:].float().expand(3, -1, -1, -1), atol=1e-3, rtol=0.0
    )
    assert not flown["next", "off_map"].any()
    physics = Physics(scenario, dtype=torch.float64)
    generator = torch.Generator()
    told = estimate_return(physics, plan.path, "hybrid", 1, generator, plan.share)[0]
    earned = flown["next", "reward"].sum(dim=-2)
    torch.testing.assert_close(earned, torch.full_like(earned, told), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("name", ["one", "power", "two"])
def test_refined_flights_bring_no_less(name: str) -> None:
    scenario = CASES[name]
    physics, policy = Physics(scenario, dtype=torch.float64), policy_of(scenario)
    before, better = policy.plan(), refined(policy)
    env = make_env(scenario, batch_size=(1,), seed=0)
    flown = env.rollout(scenario.num_slots, better)["next", "reward"].sum()
    told = estimate_return(physics, before.path, "hybrid", 1, torch.Generator(), before.share)[0]
    assert float(flown) >= told * (1 - 1e-5)


def test_rows_elsewhere_are_flown_from_where_they_are() -> None:
    scenario = CASES["one"]
    policy = policy_of(scenario)
    env = make_env(scenario, batch_size=(2,), seed=0)
    state = env.reset()
    state["position"] = torch.tensor([[[0.0, 0.0]], [[90.0, -90.0]]])
    acted = policy(state)["action"]
    assert acted.abs().max() <= 1.0
    assert not torch.equal(acted[0], acted[1])


def test_where_nothing_can_be_earned_it_flies_all_the_same() -> None:
    scenario = dataclasses.replace(CASES["one"], coverage_radius=1.0)
    with pytest.warns(UserWarning, match="nothing can be earned") as told:
        path, share = policy_of(scenario).plan()
    assert [str(line.message)[:21] for line in told] == ["coverage_radius = 1 m"]
    assert path.isfinite().all()
    assert share.isfinite().all()


@pytest.mark.parametrize(("name", "seed"), [("many", 13), ("many", 22)])
def test_several_helpers_earn_no_less_than_their_rough_flight(name: str, seed: int) -> None:
    scenario, mode_rule = family(name, seed, "validation")
    scenario = dataclasses.replace(scenario, fading=False)
    physics = Physics(scenario, dtype=torch.float64)
    led, rough = (
        estimate_return(physics, path.double(), mode_rule, 1, torch.Generator(), share.double())[0]
        for path, share in (
            policy_of(scenario, mode_rule).plan(),
            roughly_best(scenario, mode_rule),
        )
    )
    assert led >= rough * (1 - 1e-5) > 10.0


@pytest.mark.parametrize("seed", [15, 89])
def test_no_flight_goes_to_the_lesser_of_two_places(seed: int) -> None:
    scenario, mode_rule = family("one", seed)
    optimum = solve_optimum(
        scenario, [mode_rule], resolution=4.0, draws=32, evaluation_draws=2, certify=False
    )[mode_rule]
    policy, best = policy_of(scenario, mode_rule), optimum.policy
    physics = Physics(scenario, dtype=torch.float64)
    plan, better = policy.plan(), refined(policy)
    flown, improved, highest = (
        estimate_return(physics, path.double(), mode_rule, 200, torch.Generator().manual_seed(0))[0]
        for path in (plan.path, better.path, best.path)
    )
    assert flown >= 0.97 * highest
    assert improved >= 0.99 * highest


def test_relays_that_earn_quietly_and_by_luck_are_found() -> None:
    scenario, mode_rule = family("two", 276, "test")
    scenario = dataclasses.replace(scenario, num_slots=6)
    expected = ExpectedReward(Physics(scenario), 512, torch.Generator().manual_seed(0))
    start, _ = scenario.helper_starts
    hovering = torch.tensor([start, (-11.2, 25.4)]).expand(7, 2, 2)
    power = torch.tensor([1.0, 10**-3.5]).expand(6, 2)
    earned = expected.of_flight(mode_rule, *roughly_best(scenario, mode_rule))
    assert earned >= 0.7 * expected.of_flight(mode_rule, hovering, power) > 0.4
