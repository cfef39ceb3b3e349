"""The compiled update against the eager one."""

import pytest
import torch

from batches import mini_batch
from hyuav.learning.algorithms import ALGORITHMS
from hyuav.learning.compiled import CompiledUpdate, pays
from hyuav.learning.weights import copy_weights, load_weights


@pytest.mark.parametrize(
    "name",
    [
        "ddpg",
        pytest.param("td3", marks=pytest.mark.slow),
        pytest.param("sac", marks=pytest.mark.slow),
    ],
)
def test_a_compiled_update_is_the_eager_one_up_to_rounding(name: str) -> None:
    torch.manual_seed(0)
    eager, other = (ALGORITHMS[name](hidden_sizes=(12, 8)).build(2, 15) for _ in range(2))
    load_weights(other.loss, copy_weights(eager.loss))
    update = CompiledUpdate(other)
    batches = [mini_batch(2, 20) for _ in range(4)]
    for index, batch in enumerate(batches, start=1):
        torch.manual_seed(index)
        expected = eager.update_networks(batch.clone(), index)
        eager.update_targets(index)
        torch.manual_seed(index)
        losses = update(batch.clone(), index)
        torch.testing.assert_close(losses, expected, rtol=1e-4, atol=1e-5)
    weights, others = copy_weights(eager.loss), copy_weights(other.loss)
    for key, values in weights.items():
        torch.testing.assert_close(others[key], values, rtol=1e-3, atol=1e-5)
    for one, two in zip(eager.steps, other.steps, strict=True):
        moments = [step.optimizer.state_dict()["state"] for step in (one, two)]
        torch.testing.assert_close(moments[1], moments[0], rtol=1e-3, atol=1e-6)


def test_compiling_pays_for_long_trainings_only() -> None:
    assert pays(20_000, learners=1)
    assert not pays(1_000, learners=3)
    assert pays(3_000, learners=30)


def test_without_a_compiler_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert not pays(10**9, learners=100)
