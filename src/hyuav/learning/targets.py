"""What a critic learns to predict, beside TorchRL's own targets."""

from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.objectives.value import TD0Estimator

from hyuav.learning.replay import RETURN


class BoundedTD0(TD0Estimator):
    """The target of eq. 9, raised towards the return where that is higher.

    Where the helper's moves decide what follows, no flight returns more than the best one, so that
    every return is a lower bound of the best value, up to the luck of the fading (He et al.,
    "Learning to play in a day: faster deep reinforcement learning by optimality tightening", ICLR
    2017; Oh et al., "Self-imitation learning", ICML 2018). One flight that found a far and
    better region so makes it known along its whole way, at once and for as long as it is kept.

    Args:
        learners: N, each of which trusts as its own updates have it.
        bound: from 0, the target as it was, to 1, never below the return.
        decay: factor of ``bound`` after every update, so that in the end luck is not counted.
        options: of TorchRL's estimator.
    """

    def __init__(self, *, learners: int, bound: float, decay: float, **options: Any) -> None:
        super().__init__(**options)
        self.decay = decay
        self.register_buffer("bound", torch.full((learners, 1, 1), bound))

    def value_estimate(self, tensordict: TensorDictBase, *inputs: Any, **options: Any) -> Tensor:
        """The target (N, K, 1), from transitions that carry :data:`RETURN` (N, K, 1)."""
        target: Tensor = super().value_estimate(tensordict, *inputs, **options)
        excess = tensordict[RETURN] - target
        raised = target + self.bound * excess.clamp(min=0.0)  # none where it is not known yet
        # Not mul_: it would be carried out, instead of being recorded, when a slot is compiled.
        self.bound.copy_(self.bound * self.decay)
        return raised
