"""Trainings that no machine can hold are refused before any memory is taken."""

import dataclasses
from typing import Any

import pytest

from hyuav import DDPG, Guide, InputError, Learner, RobustDDPG, Scenario, Training
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.training import TrainingParameters

SCENARIO = dataclasses.replace(
    Scenario.preset("two_clusters"), num_slots=10_000, power_control=True
)
MANY_FLIGHTS = Guide(imagined_flights=100_000, power_levels=1)
MANY_LEVELS = Guide(power_levels=10**6)


@pytest.mark.parametrize(
    ("name", "algorithm", "changes"),
    [
        ("replay_size", DDPG(), {"replay_size": 10**12}),
        ("hidden_sizes", DDPG(hidden_sizes=(10**7, 10**7)), {}),
        ("imagined_flights", RobustDDPG(guide=MANY_FLIGHTS), {"replay_size": 10_000}),
        ("power_levels", RobustDDPG(guide=MANY_LEVELS), {"replay_size": 10_000}),
    ],
)
def test_what_takes_most_is_named(
    name: str, algorithm: AlgorithmParameters, changes: dict[str, Any]
) -> None:
    parameters = TrainingParameters(**changes)
    refusal = rf"^{name} = [^\n]*: expected a training of 1 learners that fits [^\n]*GiB$"
    with pytest.raises(InputError, match=refusal):
        Training(SCENARIO, [Learner()], algorithm, parameters)
