"""The generalist as an entry of a comparison: it is there at once, and learns nothing more."""

import time

import pandas as pd

from hyuav.experiments.comparison.brought import Brought
from hyuav.experiments.comparison.plan import training_episodes
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.run_directory import RunConfiguration
from hyuav.learning.generalist.pretrained import pretrained


def fly_all(
    configuration: RunConfiguration, evaluation: EvaluationParameters
) -> tuple[pd.DataFrame, list[float], list[float]]:
    """Fly the generalist in the place of each learner; what it flies depends on no seed.

    Args:
        configuration: of the learners.
        evaluation: of what it brings.

    Returns:
        as :func:`.stable_baselines.train`: it is evaluated before the first episode, when it has
        taken the seconds that it needs to plan, and is the same after the last.
    """
    training, scenario = configuration.training, configuration.scenario
    rows, sum_rates, earned = [], [], []
    for index, learner in enumerate(configuration.learners):
        started = time.perf_counter()
        policy = pretrained("generalist").policy(scenario, learner.scheme)
        seconds = time.perf_counter() - started
        told, best = (
            Brought.by(policy, learner.scheme, configuration, episodes)
            for episodes in (training_episodes(training), evaluation)
        )
        rows += [
            {
                "learner": index,
                "episode": episode,
                "slots": episode * scenario.num_slots,
                "seconds": seconds,
                "evaluation": told.reward,
                "sum_rate": told.sum_rate,
            }
            for episode in (0, training.num_episodes)
        ]
        sum_rates.append(best.sum_rate)
        earned.append(best.earned)
    return pd.DataFrame(rows), sum_rates, earned
