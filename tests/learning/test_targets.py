"""The target that returns bound, in each of the losses."""

from typing import Any

import pytest
import torch
from tensordict import TensorDictBase

from batches import TEN_UES, mini_batch
from hyuav.learning.algorithms import ALGORITHMS, Algorithm
from hyuav.learning.replay import RETURN
from hyuav.randomness import given_normals

NAMES = ["ddpg", "td3", "sac"]


def built(name: str, bound: float) -> Algorithm:
    torch.manual_seed(0)
    return ALGORITHMS[name](clock=False, hidden_sizes=(8,), return_bound=bound, discount=0.9).build(
        2, TEN_UES
    )


def target(name: str, bound: float, batch: TensorDictBase) -> torch.Tensor:
    """What the critic is to predict of each transition (2, K): where its loss is least."""
    algorithm = built(name, bound)
    targets: list[torch.Tensor] = []
    estimate = algorithm.loss.value_estimator.value_estimate

    def record(*inputs: Any, **options: Any) -> torch.Tensor:
        targets.append(estimate(*inputs, **options))
        return targets[-1]

    algorithm.loss.value_estimator.value_estimate = record
    with given_normals(iter([torch.zeros(2, batch.shape[1], 2)] * 4)):
        algorithm.steps[0].loss(batch.clone())
    return targets[0].squeeze(-1)


@pytest.mark.parametrize("name", NAMES)
def test_a_return_below_the_target_changes_nothing(name: str) -> None:
    batch = mini_batch(2, 5)
    plain = target(name, 0.0, batch)
    for low in (-torch.inf, -100.0):
        batch[RETURN] = torch.full((2, 5, 1), low)
        torch.testing.assert_close(target(name, 0.7, batch), plain)


@pytest.mark.parametrize("name", NAMES)
def test_a_return_above_the_target_raises_it(name: str) -> None:
    batch = mini_batch(2, 5)
    plain = target(name, 0.0, batch)
    batch[RETURN] = (plain + 3.0).unsqueeze(-1)
    torch.testing.assert_close(target(name, 0.25, batch), plain + 0.75)
    torch.testing.assert_close(target(name, 1.0, batch), plain + 3.0)


@pytest.mark.parametrize("name", NAMES)
def test_an_update_with_returns_not_known_yet_is_finite(name: str) -> None:
    algorithm, batch = built(name, 0.5), mini_batch(2, 5)
    batch[RETURN] = torch.full((2, 5, 1), -torch.inf)
    algorithm.update_networks(batch, 1)
    for values in algorithm.loss.state_dict().values():
        assert bool(values.isfinite().all())


@pytest.mark.parametrize("name", NAMES)
def test_trust_in_returns_fades(name: str) -> None:
    parameters = ALGORITHMS[name](
        clock=False, hidden_sizes=(8,), return_bound=0.8, return_bound_decay=0.5
    )
    algorithm = parameters.build(2, TEN_UES)
    batch = mini_batch(2, 5)
    batch[RETURN] = torch.full((2, 5, 1), -torch.inf)
    for update in range(1, 4):
        algorithm.update_networks(batch.clone(), update)
    bound = algorithm.loss.value_estimator.get_buffer("bound")
    assert bound.flatten().tolist() == pytest.approx([0.1, 0.1])
    assert any(key.endswith(".bound") for key in algorithm.modules.state_dict())  # is resumed
