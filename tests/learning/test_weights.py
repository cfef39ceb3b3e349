import pytest
import torch
from tensordict import TensorDict

from hyuav.errors import InputError
from hyuav.learning.algorithms import ALGORITHMS, DDPG
from hyuav.learning.weights import (
    copy_weights,
    load_weights,
    replace_learners,
    select_learner,
)


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_a_selected_learner_acts_as_it_does_among_others(name: str) -> None:
    many = ALGORITHMS[name](hidden_sizes=(8,)).build(3, 15)
    one = ALGORITHMS[name](hidden_sizes=(8,)).build(1, 15)
    load_weights(one.loss, select_learner(copy_weights(many.loss), 1))
    data = TensorDict(observation=torch.randn(3, 6, 15), batch_size=[3, 6])
    expected = many.actor(data.clone())["action"][1:2]
    torch.testing.assert_close(one.actor(data[1:2].clone())["action"], expected)


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_only_the_named_learners_are_replaced(name: str) -> None:
    algorithm = ALGORITHMS[name](hidden_sizes=(8,)).build(3, 15)
    weights = copy_weights(algorithm.loss)
    replace_learners(
        weights,
        {key: torch.full_like(values, 7.0) for key, values in weights.items()},
        torch.tensor([False, True, False]),
    )
    own = copy_weights(algorithm.loss)
    for key, values in weights.items():
        axis = -min(values.ndim, 3)
        assert bool((values.select(axis, 1) == 7.0).all())
        assert torch.equal(values.select(axis, 0), own[key].select(axis, 0))
        assert torch.equal(values.select(axis, 2), own[key].select(axis, 2))


def test_one_learners_weights_serve_all() -> None:
    one, many = DDPG(hidden_sizes=(8,)).build(1, 15), DDPG(hidden_sizes=(8,)).build(3, 15)
    load_weights(many.loss, copy_weights(one.loss))
    data = TensorDict(observation=torch.randn(1, 15).expand(3, 15), batch_size=[3])
    actions = many.actor(data)["action"]
    torch.testing.assert_close(actions[0], actions[2])


@pytest.mark.parametrize(
    "other",
    [
        DDPG(hidden_sizes=(9,)).build(2, 15),
        DDPG(hidden_sizes=(8,)).build(3, 15),
        DDPG(hidden_sizes=(8,)).build(2, 16),
        DDPG(hidden_sizes=(8, 8)).build(2, 15),
        ALGORITHMS["sac"](hidden_sizes=(8,)).build(2, 15),
    ],
    ids=["width", "learners", "observation", "depth", "algorithm"],
)
def test_other_networks_weights_are_refused_and_change_nothing(other: object) -> None:
    algorithm = DDPG(hidden_sizes=(8,)).build(2, 15)
    before = copy_weights(algorithm.loss)
    with pytest.raises(InputError, match=r"^checkpoint: [^\n]*$"):
        load_weights(algorithm.loss, copy_weights(other.loss))  # type: ignore[attr-defined]
    after = copy_weights(algorithm.loss)
    assert all(torch.equal(before[name], after[name]) for name in before)
