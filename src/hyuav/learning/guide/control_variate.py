"""What of a reward is the luck of its slot's fading, learned and taken off."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.envs.observation import ObservationLayout
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.networks import LearnerMLP
from hyuav.learning.replay import FADING
from hyuav.physics.channel import LinkRow
from hyuav.physics.scenario import Scenario

HIDDEN_SIZES = (64, 64)

LUCK = ("next", "luck")


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
        self._scale = reward_scale
        self.afterstate = Afterstate(scenario, clock=clock, geofence=True)
        self.layout = ObservationLayout(scenario, clock=clock)
        outputs = 1 + LinkRow.of(scenario).size
        self.network = LearnerMLP(learners, self.afterstate.size, HIDDEN_SIZES, outputs, "tanh")

    def forward(self, place: Tensor, clock: Tensor) -> tuple[Tensor, Tensor]:
        """What is to be expected of slots (N, ..., 1), and what each power adds (N, ..., links).

        Args:
            place: (N, ..., 2), where the helper is at their end, in units of half the map's side.
            clock: (N, ..., 1), what the clock then shows; without one it does not matter.
        """
        outputs = self.network(self.afterstate.at(place, clock)) * self._scale
        return outputs[..., :1], outputs[..., 1:]

    def _of(self, batch: TensorDictBase) -> tuple[Tensor, Tensor]:
        """As :meth:`forward`, of a mini-batch; the mode, which the fading decides, is not used."""
        following = batch["next", "observation"]
        return self(self.layout.position(following), self.layout.clock(following))

    @torch.no_grad()
    def luck(self, batch: TensorDictBase) -> Tensor:
        """What the fading added to the rewards of a mini-batch (N, K): (N, K, 1)."""
        _, weights = self._of(batch)
        return _luck(weights, batch)

    def fair(self, batch: TensorDictBase) -> TensorDictBase:
        """A mini-batch (N, K) with its rewards less their luck, which is told beside."""
        batch = batch.clone(False)
        luck = self.luck(batch)
        batch["next", "reward"] = batch["next", "reward"] - luck
        batch[LUCK] = luck
        return batch

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Squared error (N, K) of the regression on a mini-batch as :meth:`fair` gives it."""
        expected, weights = self._of(batch)
        reward = batch["next", "reward"] + batch[LUCK]
        return (reward - expected - _luck(weights, batch)).square().squeeze(-1)


def _luck(weights: Tensor, batch: TensorDictBase) -> Tensor:
    return (weights * (batch[FADING] - 1.0)).sum(dim=-1, keepdim=True)
