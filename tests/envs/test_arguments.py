"""Whatever a person would try for a number, names or positions is taken; the rest is told."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import torch

from hyuav import InputError, InputTypeError, Scenario, SecureOffloadingEnv, make_env

TWO_CLUSTERS = Scenario.preset("two_clusters")
FOUR = [np.int64(4), np.array(4), torch.tensor(4), [4], range(4, 5), np.array([4]), torch.Size([4])]


@pytest.mark.parametrize("batch_size", FOUR, ids=str)
def test_a_batch_size_may_be_of_any_kind(batch_size: Any) -> None:
    assert make_env(TWO_CLUSTERS, batch_size=batch_size).batch_size == (4,)


@pytest.mark.parametrize(
    "seeds", [range(3), np.arange(3), torch.arange(3), [np.int64(0), np.uint8(1), 2]], ids=str
)
def test_seeds_may_be_of_any_kind(seeds: Any) -> None:
    envs = [SecureOffloadingEnv(TWO_CLUSTERS, batch_size=3, seed=own) for own in ((0, 1, 2), seeds)]
    keys = [env.draws.state()["keys"] for env in envs]
    assert torch.equal(*keys)
    assert keys[0].unique().numel() == 6


def test_names_in_an_array_are_one_for_each_row() -> None:
    layouts: Any = np.array(["two_clusters", "random_disk"])
    schemes: Any = np.array(["relay", "jamming"])
    env = SecureOffloadingEnv(layouts, schemes, 2)
    assert env.schemes == ("relay", "jamming")
    assert env.scenarios == tuple(Scenario.preset(name) for name in layouts)


def test_fields_of_a_scenario_may_be_arrays_tensors_and_ranges() -> None:
    changes: dict[str, Any] = {
        "ue_positions": np.array([[1, 2], [3, 4]]),
        "legitimate_position": torch.zeros(2),
        "task_size": range(100_000, 200_001, 100_000),
        "num_slots": torch.tensor(3),
        "altitude": np.float32(50.0),
        "fading": np.False_,
    }
    changed = dataclasses.replace(TWO_CLUSTERS, **changes)
    assert changed.ue_positions == ((1.0, 2.0), (3.0, 4.0))
    assert (changed.num_slots, changed.altitude, changed.fading) == (3, 50.0, False)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"batch_size": 4.0}, "batch_size = 4.0: expected whole numbers >= 1"),
        ({"batch_size": np.array([2.0])}, r"batch_size = array\(\[2\.\]\): expected whole numbers"),
        ({"seed": np.array([0.5]), "batch_size": 1}, "seed = 0.5: expected a whole number in"),
        ({"seed": np.True_}, "seed = True: expected a whole number in"),
        ({"scheme": 3}, "scheme = 3: expected one of hybrid, relay, jamming"),
    ],
)
def test_a_wrong_type_is_told_in_one_line(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputTypeError, match=line):
        make_env(TWO_CLUSTERS, **options)


def test_as_many_seeds_as_rows_are_asked_for() -> None:
    with pytest.raises(InputError, match="one number, or one for each of 2 rows"):
        make_env(TWO_CLUSTERS, batch_size=2, seed=range(3))


def test_an_action_may_be_of_any_real_type_and_lead_gradients() -> None:
    env = make_env(dataclasses.replace(TWO_CLUSTERS, fading=False), batch_size=2)
    flown = [
        env.step(env.reset().set("action", action))["next", "position"]
        for action in (torch.ones(2, 2), torch.ones(2, 2).long(), np.ones((2, 2)))
    ]
    assert torch.equal(flown[0], flown[1])
    assert torch.equal(flown[0], flown[2])
    action = torch.full((2, 2), 0.5, requires_grad=True)
    env.step(env.reset().set("action", action))["next", "position"].sum().backward()
    assert action.grad is not None
    assert torch.equal(action.grad, torch.full((2, 2), TWO_CLUSTERS.max_speed))
    with pytest.raises(InputTypeError, match=r"action = torch.complex64: expected real numbers"):
        env.step(env.reset().set("action", torch.ones(2, 2, dtype=torch.complex64)))
