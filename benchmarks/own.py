"""This project's own training; all that the benchmark knows of it."""

import torch

from benchmarks.work import ENDLESS, SLOTS_AT_A_TIME, Work
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.robust import RobustDDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import Training, TrainingParameters

WARM_UP_EPISODES, WORKING_EPISODES = 4, 4
"""Of the robust variant: its guide's, fewer than it has by default since nobody asks what is
learned, and those after them in which all that it does is done for the first time."""


class OwnTraining:
    """Algorithm 1 for ``work.learners`` learners, without evaluations but the one at the end.

    Args:
        work: to do.
        algorithm: another one than DDPG at the work's settings.
    """

    def __init__(self, work: Work, algorithm: AlgorithmParameters | None = None) -> None:
        self.width, self.warm_up_slots = work.learners, work.batch_size + SLOTS_AT_A_TIME
        if algorithm is None:
            algorithm = DDPG(
                hidden_sizes=work.hidden_sizes,
                actor_learning_rate=work.actor_learning_rate,
                critic_learning_rate=work.critic_learning_rate,
                discount=work.discount,
                target_rate=work.target_rate,
                noise_variance=work.noise_variance,
                noise_decay=work.noise_decay,
            )
        parameters = TrainingParameters(
            num_episodes=work.episodes,
            replay_size=work.replay_size,
            batch_size=work.batch_size,
            evaluation_every=ENDLESS,
            compile=work.compile,
            cohorts=work.threads,
        )
        learners = [Learner(seed=work.seed + index) for index in range(work.learners)]
        self.training = Training(work.scenario, learners, algorithm, parameters, work.device)
        self._episodes = self.training.episodes()
        self._slots = work.scenario.num_slots

    @property
    def updates(self) -> int:
        """Made so far, by each learner."""
        return self.training.cohorts[0].updates

    def advance(self) -> int:
        """Train for one episode."""
        episode = next(self._episodes)
        if episode.accumulated_reward.is_cuda:
            torch.cuda.synchronize()
        return self._slots


class OwnRobustTraining(OwnTraining):
    """The robust variant at its own settings, measured when its guide's warm-up is over."""

    def __init__(self, work: Work) -> None:
        super().__init__(work, RobustDDPG(guide=Guide(warm_up_episodes=WARM_UP_EPISODES)))
        self.warm_up_slots = (WARM_UP_EPISODES + WORKING_EPISODES) * work.scenario.num_slots
