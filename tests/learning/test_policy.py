import dataclasses
from typing import Any

import pytest
import torch
from tensordict import TensorDictBase
from torchrl.envs import EnvBase

from batches import TEN_UES
from hyuav import InputError, RobustDDPG, Scenario, make_env
from hyuav.learning.policy import LearnedPolicy
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.weights import copy_weights

SCENARIO = Scenario.preset("two_clusters")


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
@pytest.mark.parametrize("batch_size", [(), (4,), (2, 3)])
def test_a_saved_actor_flies_any_batch(name: str, batch_size: tuple[int, ...]) -> None:
    algorithm = ALGORITHMS[name](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(3, TEN_UES).loss)
    policy = LearnedPolicy(SCENARIO, algorithm, weights, learner=2)
    env = make_env(SCENARIO, batch_size=batch_size, clock=algorithm.clock)
    flown = env.rollout(5, policy)
    assert flown["action"].shape == (*batch_size, 5, 2)
    assert not flown["action"].requires_grad


def test_a_learner_acts_as_it_did_in_training() -> None:
    algorithm = ALGORITHMS["ddpg"](hidden_sizes=(8,))
    built = algorithm.build(3, TEN_UES)
    policy = LearnedPolicy(SCENARIO, algorithm, copy_weights(built.loss), learner=1)
    observed = make_env(SCENARIO, batch_size=3).reset()
    expected = built.actor(observed.clone())["action"][1]
    torch.testing.assert_close(policy(observed.clone())["action"][1], expected)


def test_several_learners_fly_a_row_each() -> None:
    algorithm = ALGORITHMS["sac"](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(3, TEN_UES).loss)
    together = LearnedPolicy(SCENARIO, algorithm, weights, [2, 0])
    observed = make_env(SCENARIO, batch_size=(2, 4)).reset()
    actions = together(observed.clone())["action"]
    for row, learner in enumerate([2, 0]):
        alone = LearnedPolicy(SCENARIO, algorithm, weights, learner)
        torch.testing.assert_close(actions[row], alone(observed[row].clone())["action"])


def test_an_actor_of_other_ues_is_refused() -> None:
    algorithm = ALGORITHMS["ddpg"](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, TEN_UES).loss)
    fewer = dataclasses.replace(SCENARIO, ue_positions=SCENARIO.ue_positions[:4])
    with pytest.raises(InputError, match="checkpoint"):
        LearnedPolicy(fewer, algorithm, weights)


def test_a_slot_of_a_learned_policy_is_one_graph_that_is_made_once() -> None:
    algorithm = RobustDDPG(hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, TEN_UES).loss)
    policy = LearnedPolicy(TEN_UES, algorithm, weights)
    flown = []
    for compiled in (False, True):
        observed: dict[str, Any] = algorithm.environment
        env = make_env(TEN_UES, batch_size=3, seed=1, **observed)

        def fly_slot(state: TensorDictBase, env: EnvBase = env) -> TensorDictBase:
            return env.step_mdp(env.step(policy(state)))

        state = fly_slot(env.reset())
        if compiled:
            fly_slot = torch.compile(fly_slot, fullgraph=True, backend="eager")
        for slot in range(4):
            with torch.compiler.set_stance("fail_on_recompile" if slot > 0 else "default"):
                state = fly_slot(state)
        flown.append(state["episode_reward"])
    torch.testing.assert_close(*flown)
