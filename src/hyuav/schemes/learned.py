"""A trained actor as a way to fly: Proposed, Re-OT and Ja-OT."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.learning.algorithms import AlgorithmParameters
from hyuav.learning.weights import load_weights, select_learner
from hyuav.scenario import Scenario


class LearnedPolicy(TensorDictModuleBase):
    """The noise-free actor of one learner, for any batch of helpers.

    Args:
        scenario: that the actor was trained on, or another with as many UEs.
        algorithm: with which it was trained.
        weights: of N learners, as a training saves them.
        learner: which of the N.
        clock: whether the actor observes the slots flown.

    Raises:
        InputError: the weights do not fit the algorithm or the number of UEs.
    """

    in_keys = ("observation",)
    out_keys = ("action",)

    def __init__(
        self,
        scenario: Scenario,
        algorithm: AlgorithmParameters,
        weights: dict[str, Tensor],
        learner: int = 0,
        *,
        clock: bool = False,
    ) -> None:
        super().__init__()
        built = algorithm.build(1, scenario.num_ues + 5 + clock)
        load_weights(built.loss, select_learner(weights, learner))
        self.actor = built.actor

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``observation`` (..., U + 5), write ``action`` (..., 2) in [-1, 1]."""
        learner_axis_first = tensordict.select("observation").unsqueeze(0)
        tensordict["action"] = self.actor(learner_axis_first)["action"].squeeze(0)
        return tensordict
