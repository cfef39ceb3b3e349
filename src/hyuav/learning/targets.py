"""What a critic learns to predict, beside TorchRL's own targets."""

from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.objectives.value import TD0Estimator

from hyuav.learning.replay import RETURN


class RaisedTD0(TD0Estimator):
    """The target of eq. 9, raised where more is known to be possible than the actor does.

    By an alternative: in the next state the helper may act otherwise, and where that is worth
    more it counts instead, as in Q-learning, which looks for the best action there is.

    By returns: where the helper's moves decide what follows, no flight returns more than the best
    one, so that every return is a lower bound of the best value, up to the luck of the fading (He
    et al., "Learning to play in a day: faster deep reinforcement learning by optimality
    tightening", ICLR 2017; Oh et al., "Self-imitation learning", ICML 2018). One flight that
    found a far and better region so makes it known along its whole way, at once and for as long
    as it is kept.

    Args:
        learners: N, each of which trusts in returns as its own updates have it.
        alternative: maps observations (N, K, U + 5) to what acting otherwise is worth in them,
            (N, K, 1); None for no alternative.
        bound: trust in returns, from 0, none, to 1, never below the return.
        decay: factor of ``bound`` after every update, so that in the end luck is not counted.
        options: of TorchRL's estimator.
    """

    def __init__(
        self,
        *,
        learners: int,
        alternative: Callable[[Tensor], Tensor] | None = None,
        bound: float = 0.0,
        decay: float = 1.0,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._alternative, self._trusts, self._decay = alternative, bound > 0, decay
        self.register_buffer("bound", torch.full((learners, 1, 1), bound))

    def value_estimate(self, tensordict: TensorDictBase, *inputs: Any, **options: Any) -> Tensor:
        """The target (N, K, 1); a trust in returns reads them, :data:`RETURN` (N, K, 1)."""
        target: Tensor = super().value_estimate(tensordict, *inputs, **options)
        if self._alternative is not None:
            following = tensordict["next"]
            counted = self.gamma * (1.0 - following["terminated"].to(target.dtype))
            otherwise = self._alternative(following["observation"])
            target = target.maximum(following["reward"] + counted * otherwise)
        if self._trusts:
            excess = tensordict[RETURN] - target
            target = target + self.bound * excess.clamp(min=0.0)  # none where it is not known yet
            # Not mul_: it would be carried out, not recorded, when a slot is compiled.
            self.bound.copy_(self.bound * self._decay)
        return target
