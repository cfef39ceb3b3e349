"""What of a reward is the luck of its slot's fading, learned and taken off."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.learning.networks import LearnerMLP
from hyuav.learning.replay import FADING
from hyuav.scenario import Scenario

HIDDEN_SIZES = (64, 64)

LUCK = ("next", "luck")

MODE = 2
"""Where in an observation the mode stands, which depends on the slot's fading."""


class ControlVariate(nn.Module):
    """Rewards without most of the luck of the fading, and with the same mean.

    A reward is regressed on where the helper is and, linearly, on the fading powers f of the slot,
    which have unit mean whatever the helper does: r = u(s') + w(s') (f - 1) + rest. Less w (f - 1)
    it has the same expectation, however good w is, and a variance that is smaller by an order of
    magnitude (Lavenberg and Welch, "A perspective on the use of control variables to increase the
    efficiency of Monte Carlo simulations", Management Science 27(3), 1981). The powers are told
    once the slot is over. The UEs decide by them (eq. 11); the actor never sees them.

    Args:
        learners: N.
        scenario: whose links fade.
        reward_scale: of the rewards that are stored, against bps/Hz.
        clock: whether the slots flown are observed.
    """

    def __init__(
        self, learners: int, scenario: Scenario, reward_scale: float, *, clock: bool
    ) -> None:
        super().__init__()
        inputs, outputs = scenario.num_ues + 5 + clock, 1 + 3 * scenario.num_ues + 2
        self._scale = reward_scale
        self.network = LearnerMLP(learners, inputs, HIDDEN_SIZES, outputs, "tanh")

    def forward(self, following: Tensor, fading: Tensor) -> tuple[Tensor, Tensor]:
        """What is to be expected of a slot, and what its luck added, each (N, K, 1).

        Args:
            following: observations (N, K, U + 5) at the end of the slot.
            fading: powers (N, K, 3 U + 2) in the slot.
        """
        place = following.clone()
        place[..., MODE] = 0.0
        outputs = self.network(place) * self._scale
        expected, weights = outputs[..., :1], outputs[..., 1:]
        return expected, (weights * (fading - 1.0)).sum(dim=-1, keepdim=True)

    @torch.no_grad()
    def luck(self, batch: TensorDictBase) -> Tensor:
        """What the fading added to the rewards of a mini-batch (N, K): (N, K, 1)."""
        return self(batch["next", "observation"], batch[FADING])[1]

    def fair(self, batch: TensorDictBase) -> TensorDictBase:
        """A mini-batch (N, K) with its rewards less their luck, which is told beside."""
        batch = batch.clone(False)
        luck = self.luck(batch)
        batch["next", "reward"] = batch["next", "reward"] - luck
        batch[LUCK] = luck
        return batch

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Squared error (N, K) of the regression on a mini-batch as :meth:`fair` gives it."""
        expected, luck = self(batch["next", "observation"], batch[FADING])
        reward = batch["next", "reward"] + batch[LUCK]
        return (reward - expected - luck).square().squeeze(-1)
