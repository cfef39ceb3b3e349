"""Whatever the device is, every tensor is on it.

There may be no other device here than the CPU. So whatever is made without saying where is put on
the device "meta", which holds no numbers: it cannot be used together with the rest.
"""

import dataclasses
from typing import Any

import pytest
import torch

from hyuav import Learner, Scenario, Training, TrainingParameters, make_env
from hyuav.learning.registry import ALGORITHMS

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=5)
LEARNERS = [Learner("hybrid", 0), Learner("relay", 1, 4)]
SHORT = TrainingParameters(
    num_episodes=6, batch_size=8, evaluation_every=3, evaluation_episodes=5, compile="never"
)


@pytest.mark.parametrize(
    "options",
    [
        {"seed": 0, "diagnostics": True},
        {"seed": [1, 2, 3, 4], "fading": True, "clock": True, "geofence": True},
        {"seed": 0, "reward": "secrecy_energy_efficiency"},
        {"seed": 0, "reward": "proportional_fairness"},
    ],
)
def test_an_environment_keeps_to_its_device(options: dict[str, Any]) -> None:
    with torch.device("meta"):
        env = make_env(SCENARIO, "hybrid", (4,), "cpu", **options)
        state = env.reset()
        state["action"] = torch.zeros(4, 2, device="cpu")
        after = env.step(state)["next"]
    assert all(values.device.type == "cpu" for values in after.values(True, True))


def test_a_training_for_another_objective_keeps_to_its_device() -> None:
    algorithm = ALGORITHMS["ddpg"](hidden_sizes=(8,))
    with torch.device("meta"):
        training = Training(
            SCENARIO, LEARNERS, algorithm, SHORT, "cpu", reward="proportional_fairness"
        )
        *_, last = training.episodes()
    assert last.accumulated_reward.isfinite().all()


@pytest.mark.parametrize("name", list(ALGORITHMS))
def test_a_training_keeps_to_its_device(name: str) -> None:
    guided = {"guide": {"warm_up_episodes": 2}} if name.endswith("_robust") else {}
    algorithm = ALGORITHMS[name].from_dict({"hidden_sizes": [8], **guided})
    with torch.device("meta"):
        training = Training(SCENARIO, LEARNERS, algorithm, SHORT, "cpu")
        *_, last = training.episodes()
        training.load_state_dict(training.state_dict())
        training.load_weights(training.best_weights)
    assert last.accumulated_reward.isfinite().all()
    assert training.best_evaluation.isfinite().all()
