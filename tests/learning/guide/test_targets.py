"""The target that counts what acting otherwise is worth."""

import pytest
import torch
from tensordict import TensorDictBase

from batches import TEN_UES, mini_batch
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.targets import raise_target

WORTH = 3.0


def target(batch: TensorDictBase, worth: float | None) -> torch.Tensor:
    """What the critics are to predict (2, K) where acting otherwise is worth so much everywhere."""
    torch.manual_seed(0)
    loss = DDPG(hidden_sizes=(8,), discount=0.9).build(2, TEN_UES).loss
    if worth is not None:
        raise_target(loss, 0.9, lambda observed: torch.full_like(observed[..., :1], worth))
    batch = batch.clone()
    batch["next", "state_action_value"] = torch.randn(2, 5, 1)
    return torch.as_tensor(loss.value_estimator.value_estimate(batch)).squeeze(-1)


def test_an_alternative_that_is_worth_more_counts_instead() -> None:
    batch = mini_batch(2, 5)
    batch["next", "terminated"][:, 0] = True
    expected = batch["next", "reward"].squeeze(-1) + 0.9 * WORTH
    expected[:, 0] = batch["next", "reward"][:, 0, 0]
    torch.testing.assert_close(target(batch, WORTH), expected)


@pytest.mark.parametrize("worth", [-100.0, -torch.inf])
def test_an_alternative_that_is_worth_less_changes_nothing(worth: float) -> None:
    batch = mini_batch(2, 5)
    assert torch.equal(target(batch, worth), target(batch, None))
