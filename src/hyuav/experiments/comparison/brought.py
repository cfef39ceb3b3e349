"""What policies bring that another library trained, or nobody: means over the same episodes."""

from typing import NamedTuple, Self

from tensordict.nn import TensorDictModuleBase

from hyuav.experiments.evaluation import EvaluationParameters, fly
from hyuav.experiments.run_directory import RunConfiguration
from hyuav.experiments.schemes import LEARNED


class Brought(NamedTuple):
    """Means over episodes."""

    sum_rate: float
    """bps/Hz."""
    earned: float
    """By the reward."""
    reward: float
    """The same with penalties."""

    @classmethod
    def by(
        cls,
        policy: TensorDictModuleBase,
        scheme: str,
        configuration: RunConfiguration,
        episodes: EvaluationParameters,
    ) -> Self:
        """What a policy brings under a scheme.

        Args:
            policy: that is flown.
            scheme: of the learner in whose place it flies.
            configuration: tells the scenario and the reward.
            episodes: through which it flies.
        """
        scenario, reward = configuration.scenario, configuration.reward
        flights = fly(scenario, LEARNED[scheme], policy, episodes, reward=reward)
        penalized = flights.earned - scenario.off_map_penalty * flights.totals["off_map"]
        means = flights.totals["secrecy_sum_rate"], flights.earned, penalized
        return cls(*(float(each.mean()) for each in means))
