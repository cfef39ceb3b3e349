"""That the algorithms learn: short trainings of small networks."""

import dataclasses

import pytest
import torch

from hyuav import Scenario
from hyuav.learning.algorithms import ALGORITHMS
from hyuav.learning.cohort import Learner
from hyuav.learning.training import Training, TrainingParameters
from hyuav.schemes.optimum import solve

EASY = dataclasses.replace(
    Scenario.preset("two_clusters"), helper_start=(20.0, 20.0), num_slots=10, fading=False
)
"""Jamming pays within two slots of the start: a small network finds it in few episodes."""


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_a_short_training_earns_most_of_the_optimum(name: str) -> None:
    torch.set_num_threads(1)
    algorithm = ALGORITHMS[name](
        hidden_sizes=(64, 64), actor_learning_rate=1e-3, critic_learning_rate=1e-3
    )
    parameters = TrainingParameters(
        num_episodes=80, batch_size=64, evaluation_every=5, evaluation_episodes=1
    )
    training = Training(EASY, [Learner("jamming", i) for i in range(3)], algorithm, parameters)
    list(training.episodes())
    optimum = solve(EASY, ["jamming"], resolution=2.0)["jamming"].value
    assert training.best_evaluation.median().item() > 0.85 * optimum
