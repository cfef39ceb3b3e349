"""A trained actor as a way to fly: Proposed, Re-OT and Ja-OT."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.weights import join_learners, load_weights, select_learner
from hyuav.physics.scenario import Scenario


class LearnedPolicy(TensorDictModuleBase):
    """The noise-free actors of learners, for any batch of helpers.

    Args:
        scenario: that the actor was trained on, or another with as many UEs.
        algorithm: with which it was trained.
        weights: of N learners, as a training saves them.
        learner: which of the N; or several, each of which flies one row of the batch's first
            dimension.

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
        learner: int | Sequence[int] = 0,
    ) -> None:
        super().__init__()
        self._several = not isinstance(learner, int)
        learners = [learner] if isinstance(learner, int) else learner
        built = algorithm.build(len(learners), scenario)
        load_weights(built.loss, join_learners([select_learner(weights, i) for i in learners]))
        self.actor = built.actor

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``observation`` (..., U + 5), write ``action`` (..., 2) in [-1, 1]."""
        observed = tensordict.select("observation")
        if self._several:
            tensordict["action"] = self.actor(observed)["action"]
        else:
            tensordict["action"] = self.actor(observed.unsqueeze(0))["action"].squeeze(0)
        return tensordict
