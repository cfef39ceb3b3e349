import dataclasses

import pytest
import torch
from tensordict import TensorDict

from batches import TEN_UES
from hyuav._support.errors import InputError
from hyuav.learning.ddpg import DDPG
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.weights import (
    copy_weights,
    count_learners,
    draw_weights,
    finite_learners,
    join_learners,
    load_weights,
    replace_learners,
    select_learners,
)

NINE_UES = dataclasses.replace(TEN_UES, ue_positions=TEN_UES.ue_positions[1:])


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_a_selected_learner_acts_as_it_does_among_others(name: str) -> None:
    many = ALGORITHMS[name](clock=False, hidden_sizes=(8,)).build(3, TEN_UES)
    one = ALGORITHMS[name](clock=False, hidden_sizes=(8,)).build(1, TEN_UES)
    load_weights(one.loss, select_learners(copy_weights(many.loss), [1]))
    data = TensorDict(observation=torch.randn(3, 6, 15), batch_size=[3, 6])
    expected = many.actor(data.clone())["action"][1:2]
    torch.testing.assert_close(one.actor(data[1:2].clone())["action"], expected)


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_only_the_named_learners_are_replaced(name: str) -> None:
    algorithm = ALGORITHMS[name](clock=False, hidden_sizes=(8,)).build(3, TEN_UES)
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


@pytest.mark.parametrize("name", ["ddpg", "td3", "sac"])
@pytest.mark.parametrize("damage", [torch.nan, torch.inf, -torch.inf])
def test_one_number_that_is_not_finite_tells_whose_it_is(name: str, damage: float) -> None:
    loss = ALGORITHMS[name](clock=False, hidden_sizes=(8,)).build(3, TEN_UES).loss
    assert finite_learners(loss).tolist() == [True, True, True]
    for weights in loss.parameters():
        own = weights.data.select(-min(weights.ndim, 3), 1)
        last = (-1,) * own.ndim
        kept = own[last].item()
        own[last] = damage
        assert finite_learners(loss).tolist() == [True, False, True]
        own[last] = kept


def test_one_learners_weights_serve_all() -> None:
    one, many = DDPG(hidden_sizes=(8,)).build(1, TEN_UES), DDPG(hidden_sizes=(8,)).build(3, TEN_UES)
    load_weights(many.loss, copy_weights(one.loss))
    data = TensorDict(observation=torch.randn(1, 15).expand(3, 15), batch_size=[3])
    actions = many.actor(data)["action"]
    torch.testing.assert_close(actions[0], actions[2])


@pytest.mark.parametrize(
    "other",
    [
        DDPG(hidden_sizes=(9,)).build(2, TEN_UES),
        DDPG(hidden_sizes=(8,)).build(3, TEN_UES),
        DDPG(hidden_sizes=(8,)).build(2, NINE_UES),
        DDPG(hidden_sizes=(8, 8)).build(2, TEN_UES),
        ALGORITHMS["sac"](hidden_sizes=(8,)).build(2, TEN_UES),
    ],
    ids=["width", "learners", "observation", "depth", "algorithm"],
)
def test_other_networks_weights_are_refused_and_change_nothing(other: object) -> None:
    algorithm = DDPG(hidden_sizes=(8,)).build(2, TEN_UES)
    before = copy_weights(algorithm.loss)
    with pytest.raises(InputError, match=r"^checkpoint: [^\n]*$"):
        load_weights(algorithm.loss, copy_weights(other.loss))  # type: ignore[attr-defined]
    after = copy_weights(algorithm.loss)
    assert all(torch.equal(before[name], after[name]) for name in before)


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_initial_weights_are_a_learners_own_and_follow_pytorchs_law(name: str) -> None:
    many = ALGORITHMS[name](clock=False, hidden_sizes=(300, 100)).build(3, TEN_UES)
    one = ALGORITHMS[name](clock=False, hidden_sizes=(300, 100)).build(1, TEN_UES)
    draw_weights(many.loss, [4, 7, 5], "weights")
    draw_weights(one.loss, [7], "weights")
    weights, alone = copy_weights(many.loss), copy_weights(one.loss)
    selected = select_learners(weights, [1])
    assert all(torch.equal(alone[key], selected[key]) for key in alone)
    for key, values in weights.items():
        if key.endswith("layers.2.weight"):
            bound = 300**-0.5
            assert values.abs().max() <= bound
            assert values.std().item() == pytest.approx(bound / 3**0.5, rel=0.02)
            assert not torch.equal(values.select(-3, 0), values.select(-3, 1))
        if key.startswith("target_"):
            assert torch.equal(values, weights[key.removeprefix("target_")])
    if name.startswith(("td3", "sac")):
        critics = next(v for k, v in weights.items() if k.startswith("qvalue") and "0.weight" in k)
        assert not torch.equal(critics[0], critics[1])


def test_joined_learners_are_counted_and_selected_again() -> None:
    several = [copy_weights(DDPG(hidden_sizes=(8,)).build(n, TEN_UES).loss) for n in (1, 2)]
    joined = join_learners(several)
    assert [count_learners(each) for each in (*several, joined)] == [1, 2, 3]
    last = select_learners(joined, [2])
    assert all(torch.equal(last[key], select_learners(several[1], [1])[key]) for key in last)
