import dataclasses
from pathlib import Path
from typing import Any

import pytest
import torch

from hyuav import Scenario
from hyuav.errors import InputError, InputTypeError
from hyuav.learning import compiled
from hyuav.learning.algorithms import ALGORITHMS
from hyuav.learning.checkpoint import load_checkpoint, save_checkpoint
from hyuav.learning.randomness import RandomStream
from hyuav.learning.training import Training, TrainingParameters
from hyuav.learning.weights import copy_weights

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=5)
SHORT = TrainingParameters(
    num_episodes=6, replay_size=20, batch_size=8, evaluation_every=2, evaluation_episodes=4
)


def training(
    name: str = "ddpg",
    schemes: tuple[str, ...] = ("hybrid", "relay"),
    seed: int = 3,
    **changes: Any,
) -> Training:
    algorithm = ALGORITHMS[name](hidden_sizes=(16, 8))
    return Training(SCENARIO, schemes, algorithm, dataclasses.replace(SHORT, **changes), seed)


def test_there_is_one_update_after_every_slot_once_a_mini_batch_is_stored() -> None:
    trained = training()
    slots = [(episode.slots, trained.updates) for episode in trained.episodes()]
    assert slots == [(5 * n, max(0, 5 * n - 7)) for n in range(1, 7)]


def test_every_episode_reports_each_learners_undiscounted_return() -> None:
    trained = training(schemes=("hybrid",) * 3, replay_size=100)
    returns = torch.stack([episode.accumulated_reward for episode in trained.episodes()])
    rewards = trained.replay[:]["next", "reward"].squeeze(-1)
    assert returns.shape == (6, 3)
    torch.testing.assert_close(returns, rewards.reshape(6, 5, 3).sum(dim=1))


def test_evaluations_come_as_often_as_asked_and_at_the_end() -> None:
    episodes = training(num_episodes=5, evaluation_every=2).episodes()
    assert [e.number for e in episodes if e.evaluation is not None] == [2, 4, 5]


def test_the_best_weights_are_those_of_the_best_evaluation() -> None:
    trained = training(schemes=("hybrid",) * 4, num_episodes=30, evaluation_every=1)
    best = torch.full((4,), -torch.inf)
    kept = copy_weights(trained.algorithm.loss)
    for episode in trained.episodes():
        assert episode.evaluation is not None
        for learner in (episode.evaluation > best).nonzero().flatten():
            for name, values in copy_weights(trained.algorithm.loss).items():
                axis = values.ndim - 3
                kept[name].select(axis, learner).copy_(values.select(axis, learner))
        best = torch.maximum(best, episode.evaluation)
        assert torch.equal(trained.best_evaluation, best)
    assert all(torch.equal(trained.best_weights[name], kept[name]) for name in kept)


def test_the_same_seed_trains_the_same_weights() -> None:
    first, second, other = training(), training(), training(seed=4)
    for trained in (first, second, other):
        list(trained.episodes())
    left, right = copy_weights(first.algorithm.loss), copy_weights(second.algorithm.loss)
    assert all(torch.equal(left[name], right[name]) for name in left)
    changed = copy_weights(other.algorithm.loss)
    assert not all(torch.equal(left[name], changed[name]) for name in left)


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_a_restored_training_continues_bit_for_bit(name: str, tmp_path: Path) -> None:
    whole = training(name)
    list(whole.episodes())

    interrupted = training(name)
    episodes = interrupted.episodes()
    for _ in range(3):
        next(episodes)
    save_checkpoint(tmp_path / "last.pt", "training", interrupted.state_dict())

    continued = training(name)
    continued._random = RandomStream(99, torch.device("cpu"))  # nothing of it may remain
    continued.collector.env.set_seed(99)
    continued.load_state_dict(load_checkpoint(tmp_path / "last.pt", "training"))
    assert [episode.number for episode in continued.episodes()] == [4, 5, 6]
    assert (continued.slots, continued.updates) == (whole.slots, whole.updates)
    left, right = copy_weights(whole.algorithm.loss), copy_weights(continued.algorithm.loss)
    assert all(torch.equal(left[name], right[name]) for name in left)
    assert torch.equal(whole.best_evaluation, continued.best_evaluation)
    assert all(torch.equal(whole.best_weights[name], continued.best_weights[name]) for name in left)


def test_a_state_of_another_training_is_refused_in_one_line() -> None:
    state = training(schemes=("hybrid",) * 3).state_dict()
    with pytest.raises(InputError, match=r"^checkpoint: not of a training like this one[^\n]*$"):
        training().load_state_dict(state)
    with pytest.raises(InputError, match=r"^checkpoint: [^\n]*$"):
        training().load_state_dict({"weights": torch.zeros(3)})


def test_a_warm_start_begins_with_the_earlier_networks_and_targets() -> None:
    earlier = training()
    list(earlier.episodes())
    later = training(seed=8)
    later.warm_start(earlier.best_weights)
    own = copy_weights(later.algorithm.loss)
    assert all(torch.equal(own[name], earlier.best_weights[name]) for name in own)
    assert all(torch.equal(own[name], later.best_weights[name]) for name in own)


def test_learners_fly_their_own_schemes() -> None:
    trained = training(schemes=("hybrid", "relay", "jamming"))
    env = trained.collector.env
    assert env.base_env.schemes == ("hybrid", "relay", "jamming")


def test_a_clock_lengthens_the_observation_by_one() -> None:
    trained = training(clock=True)
    list(trained.episodes())
    assert trained.replay[:]["observation"].shape[-1] == SCENARIO.num_ues + 6


def test_a_mini_batch_larger_than_the_replay_is_refused() -> None:
    with pytest.raises(InputError, match="batch_size = 30: expected at most replay_size = 20"):
        TrainingParameters(replay_size=20, batch_size=30)


def test_schemes_are_a_list_and_the_algorithm_is_a_record() -> None:
    with pytest.raises(InputTypeError, match="schemes = 'hybrid'"):
        Training(SCENARIO, "hybrid", ALGORITHMS["ddpg"](), SHORT)
    with pytest.raises(InputTypeError, match="algorithm = 'ddpg'"):
        Training(SCENARIO, ["hybrid"], "ddpg", SHORT)  # type: ignore[arg-type]


def test_a_training_that_compiles_agrees_with_an_eager_one() -> None:
    eager, graph = (training(compile=choice) for choice in ("never", "always"))
    for one, two in zip(eager.episodes(), graph.episodes(), strict=True):
        torch.testing.assert_close(
            one.accumulated_reward, two.accumulated_reward, rtol=1e-3, atol=1e-3
        )


def test_where_the_compiler_fails_training_goes_on_without_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    broken = tmp_path / "g++"
    broken.write_text("#!/bin/sh\necho 'fatal error: Python.h: No such file' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", str(tmp_path / "empty-cache"))
    monkeypatch.setattr(compiled, "COMPILE_SECONDS", 0.0)
    torch._dynamo.reset()
    plain, other = training(compile="never"), training(compile="auto")
    expected = list(plain.episodes())
    with (
        torch._inductor.config.patch({"cpp.cxx": (str(broken),)}),
        pytest.warns(UserWarning, match="training goes on without compiling"),
    ):
        episodes = list(other.episodes())
    for one, two in zip(expected, episodes, strict=True):
        assert torch.equal(one.accumulated_reward, two.accumulated_reward)
