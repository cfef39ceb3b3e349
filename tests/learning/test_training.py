import dataclasses
from pathlib import Path
from typing import Any

import pytest
import torch

from hyuav import Scenario
from hyuav._support.errors import InputError, InputTypeError
from hyuav.learning.checkpoint import load_checkpoint, save_checkpoint
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.training import Training, TrainingParameters
from hyuav.learning.weights import copy_weights, join_learners, select_learners

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=5)
SHORT = TrainingParameters(
    num_episodes=6,
    replay_size=20,
    batch_size=8,
    evaluation_every=2,
    evaluation_episodes=4,
    cohorts=2,
    compile="never",
)
PAIR = (Learner("hybrid", 3), Learner("relay", 3))
MIXED = (Learner("hybrid", 1, 3), Learner("relay", 2), Learner("jamming", 1, 3), Learner(seed=9))
NAMES = sorted(ALGORITHMS)


def training(name: str = "ddpg", learners: tuple[Learner, ...] = PAIR, **changes: Any) -> Training:
    algorithm = ALGORITHMS[name](hidden_sizes=(16, 8))
    return Training(SCENARIO, learners, algorithm, dataclasses.replace(SHORT, **changes))


def seeds(*numbers: int, scheme: str = "hybrid") -> tuple[Learner, ...]:
    return tuple(Learner(scheme, seed) for seed in numbers)


def weights(trained: Training, learner: int) -> dict[str, torch.Tensor]:
    joined = join_learners([copy_weights(cohort.algorithm.loss) for cohort in trained.cohorts])
    return select_learners(joined, [trained._order[learner]])


def test_there_is_one_update_after_every_slot_once_a_mini_batch_is_stored() -> None:
    trained = training()
    slots = [(episode.slots, trained.cohorts[0].updates) for episode in trained.episodes()]
    assert slots == [((5 * n, 5 * n), max(0, 5 * n - 7)) for n in range(1, 7)]


def test_every_episode_reports_each_learners_undiscounted_return() -> None:
    trained = training(learners=seeds(1, 2, 3), replay_size=100)
    returns = torch.stack([episode.accumulated_reward for episode in trained.episodes()])
    rewards = torch.cat([c.replay[:]["next", "reward"][..., 0] for c in trained.cohorts], dim=1)
    assert returns.shape == (6, 3)
    torch.testing.assert_close(returns, rewards.reshape(6, 5, 3).sum(dim=1))


def test_evaluations_come_as_often_as_asked_and_at_the_end() -> None:
    episodes = training(num_episodes=5, evaluation_every=2).episodes()
    assert [e.number for e in episodes if e.evaluation is not None] == [2, 4, 5]


def test_each_learner_has_a_policy_that_earns_what_it_was_best_at() -> None:
    trained = training("td3", learners=MIXED, num_episodes=2, evaluation_episodes=500)
    *_, _ = trained.episodes()
    for index, policy in enumerate(trained.policies):
        assert policy.environment["scheme"] == MIXED[index].scheme
        flown = policy.make_env(batch_size=(3000,), seed=5).rollout(20, policy)
        assert flown.shape[-1] == trained.horizons[index]
        earned = flown["next", "episode_reward"][:, -1].mean().item()
        best = trained.best_evaluation[index].item()
        assert earned == pytest.approx(best, rel=0.1, abs=0.3)


def test_the_best_weights_are_those_of_the_best_evaluation() -> None:
    trained = training(learners=seeds(1, 2, 3, 4), num_episodes=30, evaluation_every=1)
    best = torch.full((4,), -torch.inf)
    kept = [weights(trained, learner) for learner in range(4)]
    for episode in trained.episodes():
        assert episode.evaluation is not None
        for learner in (episode.evaluation.reward > best).nonzero().flatten().tolist():
            kept[learner] = weights(trained, learner)
        best = torch.maximum(best, episode.evaluation.reward)
        assert torch.equal(trained.best_evaluation, best)
    for learner, own in enumerate(kept):
        best_weights = select_learners(trained.best_weights, [learner])
        assert all(torch.equal(best_weights[name], own[name]) for name in own)


@pytest.mark.parametrize("name", NAMES)
def test_a_learner_learns_the_same_alone_and_among_others(name: str) -> None:
    """Its numbers are its own; differently shaped products round differently."""
    among = training(name, MIXED, cohorts=1, num_episodes=4)
    for episode in among.episodes():
        assert episode.slots == (3 * episode.number, 5 * episode.number) * 2
    for index, learner in enumerate(MIXED):
        alone = training(name, (learner,), num_episodes=4)
        list(alone.episodes())
        own, shared = weights(alone, 0), weights(among, index)
        for key, values in own.items():
            torch.testing.assert_close(shared[key], values, rtol=1e-3, atol=1e-5)


def test_how_learners_are_divided_into_cohorts_changes_nothing_but_rounding() -> None:
    few, many = training(learners=MIXED, cohorts=1), training(learners=MIXED, cohorts=3)
    assert [len(few.cohorts), len(many.cohorts)] == [2, 4]
    for one, other in zip(few.episodes(), many.episodes(), strict=True):
        torch.testing.assert_close(
            one.accumulated_reward, other.accumulated_reward, rtol=1e-3, atol=1e-3
        )


def test_many_learners_form_several_cohorts_for_each_thread() -> None:
    def sizes(learners: int, cohorts: int) -> list[int]:
        trained = training(learners=seeds(*range(learners)), cohorts=cohorts)
        return [len(cohort.learners) for cohort in trained.cohorts]

    assert sizes(10, 2) == [5, 5]
    assert sizes(15, 2) == [4, 4, 4, 3]
    assert sizes(10, 1) == [5, 5]
    assert sizes(3, 8) == [1, 1, 1]


@pytest.mark.parametrize("name", NAMES)
def test_disturbing_one_learner_leaves_the_others_bit_for_bit(name: str) -> None:
    plain, disturbed = (training(name, seeds(1, 2, 3), cohorts=1, num_episodes=4) for _ in range(2))
    for parameter in disturbed.cohorts[0].algorithm.loss.parameters():
        parameter.data.select(-min(parameter.ndim, 3), 1).add_(0.1)
    list(plain.episodes())
    list(disturbed.episodes())
    for learner in (0, 2):
        one, other = weights(plain, learner), weights(disturbed, learner)
        assert all(torch.equal(one[key], other[key]) for key in one)
    one, other = weights(plain, 1), weights(disturbed, 1)
    assert not any(torch.equal(one[key], other[key]) for key in one)


def test_learners_of_other_seeds_or_schemes_learn_differently() -> None:
    trained = training(learners=(*seeds(3, 4), Learner("jamming", 3)))
    list(trained.episodes())
    first, other_seed, other_scheme = (weights(trained, index) for index in range(3))
    for other in (other_seed, other_scheme):
        assert not any(torch.equal(first[key], other[key]) for key in first)


@pytest.mark.parametrize("name", NAMES)
def test_a_restored_training_continues_bit_for_bit(name: str, tmp_path: Path) -> None:
    whole = training(name)
    episodes = whole.episodes()
    for _ in range(3):
        next(episodes)
    save_checkpoint(tmp_path / "last.pt", "training", whole.state_dict())
    list(episodes)

    continued = training(name)
    next(continued.episodes())  # nothing of it may remain
    continued.load_state_dict(load_checkpoint(tmp_path / "last.pt", "training"))
    assert [episode.number for episode in continued.episodes()] == [4, 5, 6]
    for learner in range(2):
        left, right = weights(whole, learner), weights(continued, learner)
        assert all(torch.equal(left[key], right[key]) for key in left)
    assert torch.equal(whole.best_evaluation, continued.best_evaluation)
    best = whole.best_weights, continued.best_weights
    assert all(torch.equal(best[0][key], best[1][key]) for key in best[0])


def test_a_finished_training_goes_on_for_longer_bit_for_bit() -> None:
    whole, first = training("ddpg_robust"), training("ddpg_robust", num_episodes=4)
    list(whole.episodes()), list(first.episodes())
    longer = training("ddpg_robust", num_episodes=6)
    longer.load_state_dict(first.state_dict())
    assert [episode.number for episode in longer.episodes()] == [5, 6]
    for index in range(2):
        left, right = weights(whole, index), weights(longer, index)
        assert all(torch.equal(left[key], right[key]) for key in left)
    assert torch.equal(whole.best_evaluation, longer.best_evaluation)


def test_an_evaluation_for_being_the_last_changes_nothing_that_learning_builds_on() -> None:
    ended, under_way = (training("ddpg_robust", num_episodes=number) for number in (3, 6))
    (*_, last), episodes = list(ended.episodes()), under_way.episodes()
    for _ in range(3):
        next(episodes)
    assert last.evaluation is not None
    for one, other in zip(ended.cohorts, under_way.cohorts, strict=True):
        own, expected = one.state_dict()["modules"], other.state_dict()["modules"]
        assert own.keys() == expected.keys()
        assert all(torch.equal(own[name], values) for name, values in expected.items())


def test_a_state_of_another_training_is_refused_in_one_line() -> None:
    state = training(learners=seeds(1, 2, 3)).state_dict()
    with pytest.raises(InputError, match=r"^checkpoint: not of a training like this one[^\n]*$"):
        training().load_state_dict(state)
    with pytest.raises(InputError, match=r"^checkpoint: [^\n]*$"):
        training().load_state_dict({"weights": torch.zeros(3)})


def test_a_warm_start_begins_with_the_earlier_networks_and_targets() -> None:
    earlier = training()
    list(earlier.episodes())
    later = training(learners=seeds(8, 9))
    later.warm_start(earlier.best_weights)
    for learner in range(2):
        own, best = weights(later, learner), select_learners(later.best_weights, [learner])
        before = select_learners(earlier.best_weights, [learner])
        assert all(torch.equal(own[key], before[key]) for key in own)
        assert all(torch.equal(best[key], before[key]) for key in own)
    three = training(learners=seeds(1, 2, 3)).best_weights
    for cohorts in (1, 2):
        with pytest.raises(InputError, match="it holds 3 learners: expected 6 learners, or one"):
            training(learners=seeds(*range(6)), cohorts=cohorts).warm_start(three)
    later.warm_start(select_learners(earlier.best_weights, [1]))
    assert all(
        torch.equal(values, weights(later, 1)[key]) for key, values in weights(later, 0).items()
    )


def test_learners_fly_their_own_schemes_and_horizons() -> None:
    trained = training(learners=MIXED)
    flown = [
        (scheme, cohort.scenario.num_slots)
        for cohort in trained.cohorts
        for scheme in cohort.env.base_env.schemes
    ]
    assert flown == [("hybrid", 3), ("jamming", 3), ("relay", 5), ("hybrid", 5)]
    assert trained.horizons == (3, 5, 3, 5)


def test_a_clock_lengthens_the_observation_by_one() -> None:
    algorithm = ALGORITHMS["ddpg"](hidden_sizes=(16, 8), clock=True)
    trained = Training(SCENARIO, PAIR, algorithm, SHORT)
    list(trained.episodes())
    assert trained.cohorts[0].replay[:]["observation"].shape[-1] == SCENARIO.num_ues + 6


def test_a_mini_batch_larger_than_the_replay_is_refused() -> None:
    with pytest.raises(InputError, match="batch_size = 30: expected at most replay_size = 20"):
        TrainingParameters(replay_size=20, batch_size=30)


@pytest.mark.parametrize("learners", ["hybrid", [], ["hybrid"], 1.5])
def test_learners_are_a_list_of_learners(learners: Any) -> None:
    with pytest.raises(InputTypeError, match=r"learners = [^\n]*: expected a list"):
        Training(SCENARIO, learners, ALGORITHMS["ddpg"](), SHORT)


def test_the_algorithm_is_a_record() -> None:
    with pytest.raises(InputTypeError, match="algorithm = 'ddpg'"):
        Training(SCENARIO, PAIR, "ddpg", SHORT)  # type: ignore[arg-type]
