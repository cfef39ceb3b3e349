"""Stable-Baselines3's DDPG as an entry of a comparison."""

import copy
import math
import time
from typing import Any

import gymnasium
import pandas as pd
from torch import nn

from hyuav.experiments.comparison.peer import ddpg_model
from hyuav.experiments.comparison.plan import training_episodes
from hyuav.experiments.evaluation import EvaluationParameters, fly
from hyuav.experiments.run_directory import RunConfiguration
from hyuav.experiments.schemes import LEARNED
from hyuav.learning.policy import Policy
from hyuav.learning.train import Learner
from hyuav.physics.scenario import Scenario


def train(
    configuration: RunConfiguration, evaluation: EvaluationParameters
) -> tuple[pd.DataFrame, list[float]]:
    """Train the learners one after another, with the paper's hyperparameters.

    They are evaluated as this project's own are, after as many episodes and in the same ones.

    Args:
        configuration: of the training; its algorithm's hyperparameters are the paper's.
        evaluation: of each learner's best weights.

    Returns:
        a row for each evaluation and learner, as :meth:`.shards.Shard.tables` takes them, and what
        each learner's best weights earn in bps/Hz.
    """
    rows, sum_rates = [], []
    for index, learner in enumerate(configuration.learners):
        own, sum_rate = _train(configuration, learner, evaluation)
        rows += [{"learner": index, **row} for row in own]
        sum_rates.append(sum_rate)
    return pd.DataFrame(rows), sum_rates


def _train(
    configuration: RunConfiguration, learner: Learner, evaluation: EvaluationParameters
) -> tuple[list[dict[str, Any]], float]:
    started, scenario, training = (
        time.perf_counter(),
        configuration.scenario,
        configuration.training,
    )
    env = gymnasium.make(
        "hyuav/SecureOffloading-v0",
        scenario=scenario,
        scheme=learner.scheme,
        disable_env_checker=True,
    )
    model = ddpg_model(
        "stable_baselines3",
        env,
        nn.Tanh,
        batch_size=training.batch_size,
        replay_size=training.replay_size,
        seed=learner.seed,
        device="cpu",
    )
    policy = Policy(model.policy.actor, scenario, learner.scheme)
    rows, episode, best, best_weights = [], 0, -math.inf, policy.state_dict()
    while episode < training.num_episodes:
        episodes = min(training.evaluation_every, training.num_episodes - episode)
        slots = episodes * scenario.num_slots
        model.learn(slots, reset_num_timesteps=False, log_interval=None)
        episode += episodes
        sum_rate, reward = _earned(policy, training_episodes(training))
        if reward > best:
            best, best_weights = reward, copy.deepcopy(policy.state_dict())
        rows.append(
            {
                "episode": episode,
                "slots": episode * scenario.num_slots,
                "seconds": time.perf_counter() - started,
                "evaluation": reward,
                "sum_rate": sum_rate,
            }
        )
    policy.load_state_dict(best_weights)
    return rows, _earned(policy, evaluation)[0]


def _earned(policy: Policy, episodes: EvaluationParameters) -> tuple[float, float]:
    """Means over the episodes in bps/Hz: the secrecy sum-rate, and the reward with penalties."""
    scenario: Scenario = policy.environment["scenario"]
    scheme = LEARNED[policy.environment["scheme"]]
    totals = fly(scenario, scheme, policy, episodes).totals
    sum_rate = totals["secrecy_sum_rate"]
    reward = sum_rate - scenario.off_map_penalty * totals["off_map"]
    return float(sum_rate.mean()), float(reward.mean())
