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
    """Fly the generalist once under each scheme; what it flies depends on no seed.

    Args:
        configuration: of the learners in whose places it flies.
        evaluation: of what it brings.

    Returns:
        as :func:`.stable_baselines.train`: it is evaluated before the first episode, when it has
        taken the seconds that it needs to plan, and is the same after the last.
    """
    episodes, learners = configuration.training.num_episodes, configuration.learners
    schemes = dict.fromkeys(learner.scheme for learner in learners)
    flown = {scheme: _flown(configuration, scheme, evaluation) for scheme in schemes}
    rows = [
        {
            "learner": index,
            "episode": episode,
            "slots": episode * configuration.scenario.num_slots,
            **flown[learner.scheme][0],
        }
        for index, learner in enumerate(learners)
        for episode in (0, episodes)
    ]
    best = [flown[learner.scheme][1] for learner in learners]
    return pd.DataFrame(rows), [own.sum_rate for own in best], [own.earned for own in best]


def _flown(
    configuration: RunConfiguration, scheme: str, evaluation: EvaluationParameters
) -> tuple[dict[str, float], Brought]:
    """What is told of it in training, and what it brings in the evaluation."""
    started = time.perf_counter()
    policy = pretrained("generalist").policy(configuration.scenario, scheme)
    seconds = time.perf_counter() - started
    told, best = (
        Brought.by(policy, scheme, configuration, episodes)
        for episodes in (training_episodes(configuration.training), evaluation)
    )
    numbers = {"seconds": seconds, "evaluation": told.reward, "sum_rate": told.sum_rate}
    return numbers, best
