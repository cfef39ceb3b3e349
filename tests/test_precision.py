"""Whatever PyTorch's default type and device are, all numbers are what they always are.

Every tensor's type is stated; so nothing is promoted where a whole number or a flag meets one of
Python's numbers. What is made without saying where is on the device "meta", which holds no numbers.
"""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from hyuav import (
    EvaluationParameters,
    Learner,
    Scenario,
    Training,
    TrainingParameters,
    evaluate,
    ja_lt,
    make_env,
    random_layout,
    re_lt,
    slot,
    solve_optimum,
)
from hyuav.envs.rendering import render_frame
from hyuav.learning.policy import learned_policy
from hyuav.learning.registry import ALGORITHMS
from hyuav.physics.outcome import Control
from hyuav.physics.slot import Physics
from hyuav.viz.data.maps import helper_map

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=5)
FULL_EDGE = dataclasses.replace(SCENARIO, edge_energy_budget=1.0, speed_limit="disc")
SHORT = TrainingParameters(
    num_episodes=6, batch_size=8, evaluation_every=3, evaluation_episodes=5, compile="never"
)


@contextmanager
def other_defaults(dtype: torch.dtype) -> Iterator[None]:
    torch.set_default_dtype(dtype)
    try:
        with torch.device("meta"):
            yield
    finally:
        torch.set_default_dtype(torch.float32)


def leaves(value: Any, place: str = "") -> dict[str, Any]:
    """All numbers in nested dicts, lists, records and tensordicts, by their place."""
    if dataclasses.is_dataclass(value):
        value = vars(value)
    if isinstance(value, dict) or hasattr(value, "batch_size"):
        named = value.items()
    elif isinstance(value, list | tuple):
        named = enumerate(value)
    else:
        return {place: value}
    return {k: v for name, own in named for k, v in leaves(own, f"{place}.{name}").items()}


def assert_equal(found: Any, expected: Any) -> None:
    own, other = leaves(found), leaves(expected)
    assert own.keys() == other.keys()
    for place, value in own.items():
        if isinstance(value, torch.Tensor | np.ndarray):
            assert value.dtype == other[place].dtype, place
            np.testing.assert_array_equal(value, other[place], err_msg=place)
        elif hasattr(value, "columns"):
            assert value.equals(other[place]), place
        else:
            assert value == other[place] or value != value, place


def flights() -> Any:
    brought = []
    more: dict[str, Any] = {"diagnostics": True, "fading": True, "clock": True, "geofence": True}
    seeds: list[Any] = [3, [1, 2, 3]]
    for scenario, seed in zip((SCENARIO, FULL_EDGE), seeds, strict=True):
        env = make_env(scenario, ["hybrid", "relay", "jamming"], 3, seed=seed, **more)
        state = env.reset()
        for _ in range(7):
            state["action"] = torch.full((3, 2), -0.3, dtype=torch.float32, device="cpu")
            flown = env.step(state)
            state = env.step_mdp(flown)
            brought.append(flown.clone())
    return brought


def gymnasiums() -> Any:
    one: Any = gymnasium.make("hyuav/SecureOffloading-v0", scenario=SCENARIO, clock=True)
    many = gymnasium.make_vec("hyuav/SecureOffloading-v0", 3, scenario=SCENARIO, clock=True)
    brought = [one.observation_space.high, one.reset(seed=1), many.reset(seed=2)]
    for _ in range(5):
        brought += [one.step(np.full(2, 0.4)), many.step(np.full((3, 2), -0.4))]
        assert one.observation_space.contains(brought[-2][0])
    return brought


def references() -> Any:
    scenario = Scenario.preset("two_clusters")
    optima = solve_optimum(scenario, resolution=10.0, draws=8, evaluation_draws=20)
    straight = {"re_lt": [re_lt(scenario)], "ja_lt": [ja_lt(scenario)]}
    best = {"optimum": [optima["hybrid"].policy]}
    flown = evaluate(scenario, "", best | straight, EvaluationParameters(episodes=4))
    return optima, flown, random_layout(0), random_layout(1)


def pictures() -> Any:
    physics = Physics(FULL_EDGE)
    north = torch.tensor([[0.0, 20.0]], dtype=torch.float32, device="cpu")
    tasks = make_env(FULL_EDGE, seed=0).base_env.draws.tasks()
    outcome = slot(physics, physics.nodes, Control(north), tasks=tasks)
    path = [(0.0, 0.0), (10.0, 20.0)]
    return outcome, list(helper_map(FULL_EDGE, 20.0)), render_frame(SCENARIO, path, [1, 0])


@pytest.mark.parametrize("dtype", [torch.float64, torch.bfloat16])
@pytest.mark.parametrize("numbers", [flights, gymnasiums, references, pictures])
def test_numbers_do_not_depend_on_the_default_type(
    numbers: Callable[[], Any], dtype: torch.dtype
) -> None:
    expected = numbers()
    with other_defaults(dtype):
        found = numbers()
    assert_equal(found, expected)


def trained(name: str, compiled: str = "never") -> Any:
    guided = {"guide": {"warm_up_episodes": 2}} if name.endswith("_robust") else {}
    algorithm = ALGORITHMS[name].from_dict({"hidden_sizes": [8], **guided})
    parameters = dataclasses.replace(SHORT, compile=compiled)
    training = Training(SCENARIO, [Learner("relay", 1)], algorithm, parameters)
    episodes = list(training.episodes())
    policy = learned_policy(SCENARIO, algorithm, training.best_weights)
    options: dict[str, Any] = algorithm.environment
    env = make_env(SCENARIO, batch_size=2, seed=0, **options)
    action = policy(env.reset())["action"]
    return episodes, training.state_dict(), action


@pytest.mark.parametrize("name", list(ALGORITHMS))
def test_what_is_learned_does_not_depend_on_the_default_type(name: str) -> None:
    expected = trained(name)
    with other_defaults(torch.float64):
        found = trained(name)
    assert_equal(found, expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ddpg_robust", "sac"])
def test_nor_does_what_is_learned_by_compiled_programs(name: str) -> None:
    expected = trained(name, "always")
    with other_defaults(torch.float64):
        found = trained(name, "always")
    assert_equal(found, expected)
