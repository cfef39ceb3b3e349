"""What stands beside a training: evaluating five schemes, and the exact optimum of three."""

import torch

from benchmarks.work import Work
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.policies import straight_policies
from hyuav.experiments.schemes import LEARNED, NO_HELPER
from hyuav.learning.ddpg import DDPG
from hyuav.learning.policy import learned_policy
from hyuav.learning.weights import copy_weights, draw_weights
from hyuav.references.optimum import solve_optimum


class FiveSchemes:
    """Fly the three learned and the two linear schemes for ``work.episodes`` episodes each.

    The actors are untrained, which takes as long.

    Args:
        work: its scenario is flown.
    """

    width, warm_up_slots = 1, 0

    def __init__(self, work: Work) -> None:
        torch.set_num_threads(work.threads)
        self.work, scenario = work, work.scenario
        algorithm = DDPG(hidden_sizes=work.hidden_sizes)
        loss = algorithm.build(1, scenario).loss
        draw_weights(loss, [work.seed], "weights")
        actor = learned_policy(scenario, algorithm, copy_weights(loss))
        straight, _ = straight_policies(scenario)
        del straight[NO_HELPER]
        self.policies = {name: [actor] for name in LEARNED.values()} | straight

    def advance(self) -> int:
        """Evaluate all of them once."""
        parameters = EvaluationParameters(episodes=self.work.episodes, seed=self.work.seed)
        evaluate(self.work.scenario, "benchmark", self.policies, parameters)
        return len(self.policies) * self.work.episodes * self.work.scenario.num_slots


class Optima:
    """Solve for the best flights of the three mode rules on the default grid.

    Args:
        work: its scenario is solved.
    """

    width, warm_up_slots = 1, 0

    def __init__(self, work: Work) -> None:
        torch.set_num_threads(work.threads)
        self.scenario = work.scenario

    def advance(self) -> int:
        """Solve once."""
        return len(solve_optimum(self.scenario)) * self.scenario.num_slots
