"""The best flight by another reward than the secrecy sum-rate."""

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from hyuav import FlightPolicy, InputError, Reward, Scenario, make_env, solve_optimum
from hyuav.physics.outcome import SlotOutcome
from hyuav.references.grid import Reach

EFFICIENCY = "secrecy_energy_efficiency"
SMALL = dataclasses.replace(
    Scenario.preset("two_clusters"),
    fading=False,
    num_slots=3,
    helper_starts=((-40.0, 0.0),),
)


def served(slot: SlotOutcome) -> Tensor:
    return slot.offloading.double().mean(dim=-1, keepdim=True)


def lazy(slot: SlotOutcome) -> Tensor:
    """The same less a price of flying."""
    return served(slot).sub(1e-4 * slot.flight_energy)


def earned(path: Tensor, scheme: str, reward: Any) -> float:
    """What a flight brings in an environment without fading."""
    env = make_env(SMALL, scheme, seed=0, reward=reward)
    flown = env.rollout(SMALL.num_slots, FlightPolicy(path, SMALL))
    return float(flown["next", "episode_reward"][-1])


@pytest.mark.parametrize("scheme", ["hybrid", "relay"])
@pytest.mark.parametrize("reward", [EFFICIENCY, served, lazy])
def test_no_flight_over_the_grid_earns_more(reward: Any, scheme: str) -> None:
    best = solve_optimum(SMALL, [scheme], resolution=20.0, reward=reward)[scheme]
    moves = [torch.tensor(move) for move in itertools.product((-20.0, 0.0, 20.0), repeat=2)]
    flights = []
    for several in itertools.product(moves, repeat=3):
        path = torch.cumsum(torch.stack([torch.tensor([-40.0, 0.0]), *several]), dim=0)
        if (path.abs() <= 100.0).all():
            flights.append(path)
    start = torch.stack(flights)[:, :, None]
    env = make_env(SMALL, scheme, (len(flights),), seed=0, reward=reward)
    state, total = env.reset(), torch.zeros(len(flights), 1)
    for slot in range(3):
        action = (start[:, slot + 1] - state["position"]).flatten(-2) / 20.0
        flown = env.step(state.set("action", action * (1 - 1e-6)))
        total += flown["next", "reward"]
        state = env.step_mdp(flown)
    assert best.value > 0.0
    assert best.value == pytest.approx(float(total.max()), rel=2e-3)
    assert best.value == pytest.approx(earned(best.path, scheme, reward), rel=1e-3)


def test_the_best_arrival_by_each_displacement_is_found_as_by_any() -> None:
    reach = Reach(2.0, 2.3)
    rng = np.random.default_rng(0)
    by_any = rng.random((7, 5))
    each = np.broadcast_to(by_any, (len(reach.displacements), 7, 5))
    np.testing.assert_array_equal(reach.best(each), reach.best(by_any))
    own = rng.random(each.shape)
    found = reach.best(own)
    for point in np.ndindex(7, 5):
        assert reach.argbest(each, point) == reach.argbest(by_any, point)
        ends = [np.add(point, move) for move in reach.displacements]
        worth = [
            own[place, *end]
            for place, end in enumerate(ends)
            if ((end >= 0) & (end < (7, 5))).all()
        ]
        assert found[point] == max(worth)


def test_with_fading_the_value_is_what_the_flight_earns() -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=8)
    best = solve_optimum(scenario, ["jamming"], resolution=10.0, reward=EFFICIENCY)["jamming"]
    env = make_env(scenario, "jamming", 2000, seed=1, reward=EFFICIENCY)
    returns = env.rollout(8, best.policy)["next", "episode_reward"][:, -1]
    error = float(returns.std()) / 2000**0.5 + best.standard_error
    assert abs(float(returns.mean()) - best.value) < 4 * error


def test_the_sum_rate_in_other_words_has_the_same_optimum() -> None:
    again = Reward(lambda slot: slot.sum_rate, "again")
    own, other = (
        solve_optimum(SMALL, ["hybrid"], resolution=5.0, reward=reward)["hybrid"]
        for reward in ("sum_rate", again)
    )
    assert own.value == other.value
    assert torch.equal(own.path, other.path)


@pytest.mark.parametrize(
    ("reward", "options", "line"),
    [
        ("proportional_fairness", {}, "reward = 'proportional_fairness': expected one that has an"),
        (Reward(served, depends_on="episode"), {}, r".*\(no optimum: it does not add up over sl"),
        (Reward(lazy, depends_on="position"), {}, r".*all over the map, whatever the velocity$"),
        (EFFICIENCY, {"resolution": 0.2}, r"resolution = 0\.2: expected a number of metres for"),
        (EFFICIENCY, {"resolution": -1.0}, r"resolution = -1\.0: expected a number of metres >="),
        ("fairness", {}, "reward = 'fairness': expected one of sum_rate,"),
    ],
)
def test_what_has_no_optimum_is_told_in_one_line(
    reward: Any, options: dict[str, Any], line: str
) -> None:
    with pytest.raises(InputError, match=f"^{line}"):
        solve_optimum(SMALL, ["hybrid"], reward=reward, **options)
