"""Stable-Baselines3's DDPG as an entry of a comparison."""

import copy
import math
import time
from typing import Any

import gymnasium
import pandas as pd
from torch import nn

from hyuav.experiments.comparison.brought import Brought
from hyuav.experiments.comparison.peer import ddpg_model
from hyuav.experiments.comparison.plan import training_episodes
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.run_directory import RunConfiguration
from hyuav.learning.learners import Learner
from hyuav.learning.policy import Policy


def train(
    configuration: RunConfiguration, evaluation: EvaluationParameters
) -> tuple[pd.DataFrame, list[float], list[float]]:
    """Train the learners one after another, with the paper's hyperparameters.

    They are evaluated as this project's own are, after as many episodes and in the same ones.

    Args:
        configuration: of the training; its algorithm's hyperparameters are the paper's.
        evaluation: of each learner's best weights.

    Returns:
        a row for each evaluation and learner, as :meth:`.shards.Shard.tables` takes them, the
        sum-rate of each learner's best weights in bps/Hz, and what they earn.
    """
    rows, sum_rates, earned = [], [], []
    for index, learner in enumerate(configuration.learners):
        own, best = _train(configuration, learner, evaluation)
        rows += [{"learner": index, **row} for row in own]
        sum_rates.append(best.sum_rate)
        earned.append(best.earned)
    return pd.DataFrame(rows), sum_rates, earned


def _train(
    configuration: RunConfiguration, learner: Learner, evaluation: EvaluationParameters
) -> tuple[list[dict[str, Any]], Brought]:
    started, scenario, training = (
        time.perf_counter(),
        configuration.scenario,
        configuration.training,
    )
    env = gymnasium.make(
        "hyuav/SecureOffloading-v0",
        scenario=scenario,
        scheme=learner.scheme,
        reward=configuration.reward,
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
        brought = Brought.by(policy, learner.scheme, configuration, training_episodes(training))
        if brought.reward > best:
            best, best_weights = brought.reward, copy.deepcopy(policy.state_dict())
        rows.append(
            {
                "episode": episode,
                "slots": episode * scenario.num_slots,
                "seconds": time.perf_counter() - started,
                "evaluation": brought.reward,
                "sum_rate": brought.sum_rate,
            }
        )
    policy.load_state_dict(best_weights)
    return rows, Brought.by(policy, learner.scheme, configuration, evaluation)
