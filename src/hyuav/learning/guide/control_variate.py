"""What of a reward its slot's fading brought by chance, learned and taken off."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.learning.afterstate import Afterstate
from hyuav.learning.networks import LearnerMLP
from hyuav.learning.replay import FADING
from hyuav.physics.channel import LinkRow
from hyuav.physics.scenario import Scenario

CONTROL_TERM = ("next", "control_term")


class ControlVariate(nn.Module):
    """Rewards without most of what the fading brought by chance, and with the same mean.

    A reward is regressed on where the helper is and, linearly, on the fading powers f of the slot,
    which have unit mean whatever the helper does: r = u(s') + w(s') (f - 1) + rest. Less w (f - 1)
    it has the same expectation, however good w is, and a variance that is smaller by an order of
    magnitude (Lavenberg and Welch, "A perspective on the use of control variables to increase the
    efficiency of Monte Carlo simulations", Management Science 27(3), 1981). The powers are told
    once the slot is over. The UEs decide by them (eq. 11); the actor never sees them.

    Args:
        learners: N.
        scenario: whose links fade.
        afterstate: of the scenario, whose features the network sees.
        hidden_sizes: of the network.
        reward_scale: of the rewards that are stored, against bps/Hz.
    """

    def __init__(
        self,
        learners: int,
        scenario: Scenario,
        afterstate: Afterstate,
        hidden_sizes: Sequence[int],
        reward_scale: float,
    ) -> None:
        super().__init__()
        self._scale, self.scenario = reward_scale, scenario
        self.afterstate = afterstate
        self.layout = afterstate.layout
        outputs = 1 + LinkRow.of(scenario).size
        self.network = LearnerMLP(learners, self.afterstate.size, hidden_sizes, outputs, "tanh")

    def forward(self, place: Tensor, clock: Tensor) -> tuple[Tensor, Tensor]:
        """What is to be expected of slots (N, ..., 1), and what each power adds (N, ..., links).

        Args:
            place: (N, ..., actions), where the helpers are at their end and at which power, as
                :meth:`hyuav.envs.observation.ObservationLayout.place` has it.
            clock: (N, ..., 1), what the clock then shows; without one it does not matter.
        """
        outputs = self.network(self.afterstate.at(place, clock)) * self._scale
        return outputs[..., :1], outputs[..., 1:]

    def _of(self, batch: TensorDictBase) -> tuple[Tensor, Tensor]:
        """As :meth:`forward`, of a mini-batch; the mode, which the fading decides, is not used."""
        following = batch["next", "observation"]
        return self(self.layout.place(batch), self.layout.clock(following))

    @torch.no_grad()
    def control_term(self, batch: TensorDictBase) -> Tensor:
        """What the fading added to the rewards of a mini-batch (N, K): (N, K, 1)."""
        _, weights = self._of(batch)
        return _control_term(weights, batch)

    def adjust(self, batch: TensorDictBase) -> TensorDictBase:
        """A mini-batch (N, K) with its rewards less the control term, which is told beside."""
        batch = batch.clone(False)
        control_term = self.control_term(batch)
        batch["next", "reward"] = batch["next", "reward"] - control_term
        batch[CONTROL_TERM] = control_term
        return batch

    def loss(self, batch: TensorDictBase) -> Tensor:
        """Squared error (N, K) of the regression on a mini-batch as :meth:`adjust` gives it."""
        expected, weights = self._of(batch)
        reward = batch["next", "reward"] + batch[CONTROL_TERM]
        return (reward - expected - _control_term(weights, batch)).square().squeeze(-1)


def _control_term(weights: Tensor, batch: TensorDictBase) -> Tensor:
    return (weights * (batch[FADING] - 1.0)).sum(dim=-1, keepdim=True)
