"""What a critic learns to predict, beside TorchRL's own targets."""

from collections.abc import Callable
from typing import Any

from tensordict import TensorDictBase
from torch import Tensor
from torchrl.objectives import LossModule
from torchrl.objectives.value import TD0Estimator


class RaisedTD0(TD0Estimator):
    """The target of eq. 9, raised where more is known to be possible than the actor does.

    In the next state the helper may act otherwise, and where that is worth more it counts instead,
    as in Q-learning, which looks for the best action there is.

    Args:
        alternative: maps observations (N, K, observed) to what acting otherwise is worth in
            them, (N, K, 1).
        options: of TorchRL's estimator.
    """

    def __init__(self, *, alternative: Callable[[Tensor], Tensor], **options: Any) -> None:
        super().__init__(**options)
        self._alternative = alternative

    def value_estimate(self, tensordict: TensorDictBase, *inputs: Any, **options: Any) -> Tensor:
        """The target (N, K, 1)."""
        target: Tensor = super().value_estimate(tensordict, *inputs, **options)
        following = tensordict["next"]
        counted = self.gamma * (1.0 - following["terminated"].to(target.dtype))
        otherwise = self._alternative(following["observation"])
        return target.maximum(following["reward"] + counted * otherwise)


def raise_target(loss: LossModule, gamma: float, alternative: Callable[[Tensor], Tensor]) -> None:
    """Let a loss count what acting otherwise is worth.

    Args:
        loss: whose target is TorchRL's TD(0).
        gamma: the discount.
        alternative: see :class:`RaisedTD0`.
    """
    plain = loss.value_estimator
    raised = RaisedTD0(alternative=alternative, gamma=gamma, value_network=plain.value_network)
    raised.set_keys(value=plain.tensor_keys.value)
    loss.make_value_estimator(raised)
