"""Learners that fly over a new layout in each episode."""

import copy
import dataclasses

import pytest
import torch

from hyuav import (
    DDPG,
    SAC,
    DiskLayout,
    EvaluationParameters,
    InputError,
    InputTypeError,
    LayoutFamily,
    Learner,
    RobustDDPG,
    Training,
    TrainingParameters,
    evaluate,
    solve_optimum,
)
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.policy import learned_policy

FAMILY = LayoutFamily(DiskLayout(num_ues=6))
FEW = TrainingParameters(
    num_episodes=4, batch_size=8, evaluation_every=2, evaluation_episodes=5, compile="never"
)
LEARNERS = [Learner("hybrid", 0, 5), Learner("jamming", 1, 7), Learner("hybrid", 0, 7)]
SMALL = DDPG(hidden_sizes=(8,))


def train(training: Training) -> list[torch.Tensor]:
    return [episode.accumulated_reward for episode in training.episodes()]


@pytest.mark.parametrize("algorithm", [SMALL, SAC(hidden_sizes=(8,))], ids=["ddpg", "sac"])
def test_a_training_that_is_continued_draws_the_layouts_of_an_unbroken_one(
    algorithm: AlgorithmParameters,
) -> None:
    unbroken = Training(FAMILY, LEARNERS, algorithm, FEW)
    episodes = unbroken.episodes()
    next(episodes)
    state = copy.deepcopy(unbroken.state_dict())
    rest = [episode.accumulated_reward for episode in episodes]
    continued = Training(FAMILY, LEARNERS, algorithm, FEW)
    continued.load_state_dict(state)
    for found, expected in zip(train(continued), rest, strict=True):
        assert torch.equal(found, expected)
    assert torch.equal(continued.best_evaluation, unbroken.best_evaluation)
    assert unbroken.horizons == (5, 7, 7)


def test_learners_store_transitions_of_many_layouts_and_are_evaluated_over_the_same() -> None:
    training = Training(FAMILY, LEARNERS, SMALL, FEW)
    train(training)
    distances = training.cohorts[-1].stored["observation"][: 4 * 7 : 7, :, 3:]  # at the starts
    assert len(distances.flatten(1).unique(dim=0)) == 4
    twins = [Learner("hybrid", 5), Learner("hybrid", 6)]
    alike = Training(FAMILY, twins, SMALL, FEW)
    alike.load_weights({name: own[:1] for name, own in alike.best_weights.items()})
    earned = alike.evaluate().reward
    assert earned[0] == earned[1]


@pytest.mark.slow
def test_compiled_slots_learn_over_the_same_layouts() -> None:
    learners = LEARNERS[:1]
    eager = Training(FAMILY, learners, SMALL, FEW)
    compiled = Training(FAMILY, learners, SMALL, dataclasses.replace(FEW, compile="always"))
    for found, expected in zip(train(compiled), train(eager), strict=True):
        torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-3)
    assert compiled.cohorts[0].is_compiled


def test_what_was_learned_flies_over_any_layout_of_as_many_ues() -> None:
    training = Training(FAMILY, LEARNERS[:1], SMALL, FEW)
    train(training)
    policy = learned_policy(FAMILY.scenario, SMALL, training.best_weights)
    parameters = EvaluationParameters(episodes=3, flights=1)
    found = evaluate(FAMILY.scenario, "example", {"proposed": [policy]}, parameters)
    assert found.summary["schemes"]["proposed"]["learners"] == 1


def test_what_knows_one_layout_is_refused_in_one_line() -> None:
    line = "^algorithm = 'RobustDDPG': expected one without afterstate and guide"
    for algorithm in (RobustDDPG(), RobustDDPG(guide=None), RobustDDPG(afterstate=False)):
        with pytest.raises(InputError, match=line):
            Training(FAMILY, LEARNERS, algorithm, FEW)
    plain = RobustDDPG(hidden_sizes=(8,), guide=None, afterstate=False)
    train(Training(FAMILY, LEARNERS[:1], plain, FEW))
    line = "^scenario = .*: expected a Scenario, a preset's name or UE positions"
    with pytest.raises(InputTypeError, match=line):
        solve_optimum(FAMILY)  # type: ignore[arg-type]
    with pytest.raises(InputTypeError, match=line):
        evaluate(FAMILY, "family", {"ja_lt": []}, EvaluationParameters())  # type: ignore[arg-type]
