"""How the learners, the scenario and the parameters of a training may be told."""

from typing import Any

import numpy as np
import pytest
import torch

from hyuav import DDPG, InputError, InputTypeError, Learner, Training, TrainingParameters

SMALL, SHORT = DDPG(hidden_sizes=(4,)), TrainingParameters(num_episodes=1)
SAID: dict[str, tuple[Any, tuple[int, ...]]] = {
    "a count": (3, (0, 1, 2)),
    "NumPy's count": (np.int64(2), (0, 1)),
    "a learner": (Learner(seed=7), (7,)),
    "a range": (range(2, 4), (2, 3)),
    "an array": (np.array([5, 8]), (5, 8)),
    "a tensor": (torch.tensor([5, 8]), (5, 8)),
    "both": ([Learner(seed=4), 1], (4, 1)),
}


@pytest.mark.parametrize("said", SAID)
def test_learners_may_be_told_by_count_or_seeds(said: str) -> None:
    learners, seeds = SAID[said]
    training = Training("two_clusters", learners, SMALL, SHORT)
    assert training.learners == tuple(Learner(seed=seed) for seed in seeds)


@pytest.mark.parametrize(
    ("place", "value", "line"),
    [
        (0, {"a": 1}, "scenario = {'a': 1}: expected a Scenario, a preset's name or UE positions"),
        (1, 0, "learners = 0: expected a whole number >= 1"),
        (1, [], r"learners = \[\]: expected a list of at least one Learner or seed"),
        (1, "x", "learners = 'x': expected a list of at least one Learner or seed"),
        (1, [0, True], r"learners = \[0, True\]: expected a list of at least one Learner"),
        (1, [-1], "seed = -1: expected a whole number >= 0"),
        (2, {"discount": 1}, r"algorithm = {'discount': 1}: expected DDPG\(\)"),
        (3, {"num_episodes": 1}, r"parameters = {'num_episodes': 1}: expected TrainingParameters"),
        (3, None, r"parameters = None: expected TrainingParameters\(...\)"),
    ],
)
def test_anything_else_is_told_in_one_line(place: int, value: Any, line: str) -> None:
    arguments: list[Any] = ["two_clusters", 1, SMALL, SHORT]
    arguments[place] = value
    with pytest.raises(InputError, match=line) as refused:
        Training(*arguments)
    assert isinstance(refused.value, InputTypeError) == (value not in (0, [-1]))
