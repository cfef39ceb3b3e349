"""What a critic learns to predict, beside TorchRL's own targets."""

from typing import Any

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
        bound: from 0, the target as it was, to 1, never below the return.
        options: of TorchRL's estimator.
    """

    def __init__(self, *, bound: float, **options: Any) -> None:
        super().__init__(**options)
        self.bound = bound

    def value_estimate(self, tensordict: TensorDictBase, *inputs: Any, **options: Any) -> Tensor:
        """The target (..., 1), from transitions that carry :data:`RETURN` (..., 1)."""
        target: Tensor = super().value_estimate(tensordict, *inputs, **options)
        excess = tensordict[RETURN].reshape(target.shape) - target
        return target + self.bound * excess.clamp(min=0.0)  # none where it is not known yet
