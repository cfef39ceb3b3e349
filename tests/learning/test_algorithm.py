"""What holds for every algorithm."""

import dataclasses
import warnings

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor

from batches import TEN_UES, mini_batch
from hyuav.learning.algorithm import Algorithm
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.train import Cohort, update_networks, update_targets
from hyuav.learning.weights import copy_weights, load_weights, replace_learners

NAMES = sorted(ALGORITHMS)


def build(name: str, learners: int) -> Algorithm:
    return ALGORITHMS[name](clock=False, hidden_sizes=(12, 8)).build(learners, TEN_UES)


def train(algorithm: Algorithm, disturbance: float) -> dict[str, Tensor]:
    """The weights after three updates in which learner 0's data and weights were disturbed."""
    torch.manual_seed(1)
    weights = copy_weights(algorithm.loss)
    moved = {name: values + disturbance for name, values in weights.items()}
    replace_learners(weights, moved, torch.tensor([True, False, False]))
    load_weights(algorithm.loss, weights)
    for index in range(1, 4):
        batch = mini_batch(3, 20)
        batch["next", "reward"][0] += disturbance
        batch["observation"][0] -= disturbance
        update_networks(algorithm, batch, index)
        update_targets(algorithm, index)
    return copy_weights(algorithm.loss)


def rows(values: Tensor) -> Tensor:
    """The learner axis in front."""
    return values.movedim(-min(values.ndim, 3), 0)


@pytest.mark.parametrize("name", NAMES)
def test_disturbing_one_learner_leaves_the_others_bit_for_bit(name: str) -> None:
    torch.manual_seed(0)
    first, second = build(name, 3), build(name, 3)
    load_weights(second.loss, copy_weights(first.loss))
    left, right = train(first, 0.0), train(second, 0.4)
    for key, values in left.items():
        assert torch.equal(rows(values)[1:], rows(right[key])[1:])
        assert not torch.equal(rows(values)[0], rows(right[key])[0])


@pytest.mark.parametrize("name", NAMES)
def test_explored_actions_stay_in_the_action_box(name: str) -> None:
    torch.manual_seed(0)
    explorer = build(name, 4).explorer
    data = TensorDict(observation=torch.randn(4, 15), step_count=torch.zeros(4, 1), batch_size=[4])
    actions = torch.stack([explorer(data.clone())["action"] for _ in range(50)])
    assert actions.abs().max() <= 1.0
    assert actions.std(dim=0).min() > 0.01


@pytest.mark.parametrize("name", NAMES)
def test_the_actor_is_free_of_noise(name: str) -> None:
    actor = build(name, 4).actor
    data = TensorDict(observation=torch.randn(4, 30, 15), batch_size=[4, 30])
    assert torch.equal(actor(data.clone())["action"], actor(data.clone())["action"])


@pytest.mark.parametrize("name", NAMES)
def test_the_actor_follows_what_the_explorer_learns(name: str) -> None:
    algorithm = build(name, 2)
    data = TensorDict(observation=torch.randn(2, 15), batch_size=[2])
    before = algorithm.actor(data.clone())["action"]
    for index in range(1, 5):
        update_networks(algorithm, mini_batch(2, 20), index)
    assert not torch.equal(before, algorithm.actor(data.clone())["action"])


@pytest.mark.parametrize("name", NAMES)
def test_building_warns_of_nothing(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        build(name, 2)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("clock", [False, True])
def test_the_last_slot_ends_the_return_where_the_slots_are_observed(name: str, clock: bool) -> None:
    scenario = dataclasses.replace(TEN_UES, num_slots=4)
    algorithm = ALGORITHMS[name](clock=clock, hidden_sizes=(8,))
    trained = Cohort(scenario, [Learner("relay", 0)], algorithm, 16, 8, None)
    for _ in range(2):
        trained.fly()
    ended = trained.replay[:]["next", "terminated"].flatten().tolist()
    assert ended == 2 * [False, False, False, clock]


def test_an_actor_stays_within_the_action_box() -> None:
    actor = DDPG(hidden_sizes=(8,), activation="relu").make_actor(1, TEN_UES)
    data = TensorDict(observation=1e4 * torch.randn(1, 100, 15), batch_size=[1])
    assert actor(data)["action"].abs().max() <= 1.0


def test_an_actor_may_scale_its_tanh() -> None:
    torch.manual_seed(0)
    actor = DDPG(hidden_sizes=(8,), action_scale=1.1).make_actor(2, TEN_UES)
    data = TensorDict(observation=torch.randn(2, 6, 15), batch_size=[2, 6])
    action = (1.1 * actor.module.layers(data["observation"]).tanh()).clamp(-1.0, 1.0)
    torch.testing.assert_close(actor(data)["action"], action)
