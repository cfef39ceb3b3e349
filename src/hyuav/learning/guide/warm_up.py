"""Flights to places all over the map, before anything is known of them."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.learning.guide.parameters import Guide
from hyuav.physics.scenario import Scenario

EVENLY = (0.7548776662466927, 0.5698402909980532)
"""Multiples of both fill the unit square evenly (Roberts, "The unreasonable effectiveness of
quasirandom sequences", 2018)."""


def destinations(share: Tensor, spread: float) -> Tensor:
    """Places all over the map, its edges more densely, in units of half the map's side.

    Args:
        share: (..., 2) in [0, 1).
        spread: where they are drawn, in units of the map; those beyond it are brought to its edge.
    """
    return ((2.0 * share - 1.0) * spread).clamp(-1.0, 1.0)


class WarmUp(TensorDictModuleBase):
    """Fly to places all over the map and stay there, for some episodes, whatever ``action`` says.

    The best flights go somewhere and hover. Noise about an actor never leaves the start's
    surroundings, where a far region takes many slots in one direction and little is earned on the
    way. From episode to episode the destinations fill the map evenly, and its edges more densely;
    each learner draws where in their sequence it begins, so that they cover the map whatever the
    seed, and in an order of its own. A little noise shows what is beside the trajectory.

    Args:
        learners: N; each flies on its own.
        guide: its parameters.
        scenario: its map and speed.
    """

    in_keys = ("action", "step_count", "position")
    out_keys = ("action",)

    def __init__(self, learners: int, guide: Guide, scenario: Scenario) -> None:
        super().__init__()
        self._guide, self._half_side = guide, scenario.map_side / 2
        self._reach = scenario.max_speed * scenario.slot_duration
        self.register_buffer("origin", torch.zeros(learners, 2))
        self.register_buffer("episode", torch.zeros(learners, 1))
        self.register_buffer("multiples", torch.tensor(EVENLY), persistent=False)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``action`` (N, 2), ``step_count`` (N, 1) and ``position`` (N, 1, 2) m; act."""
        action, begins = tensordict["action"], tensordict["step_count"] == 0
        normal = torch.randn_like(action)
        anywhere = torch.special.ndtr(normal)
        self.origin.copy_(torch.where(begins & (self.episode == 0), anywhere, self.origin))
        self.episode.add_(begins)
        share = torch.frac(self.origin + self.episode * self.multiples)
        destination = destinations(share, self._guide.destination_spread) * self._half_side
        towards = (destination - tensordict["position"].flatten(-2)) / self._reach
        flown = (towards + self._guide.warm_up_noise * normal).clamp(-1.0, 1.0)
        over = self.episode > self._guide.warm_up_episodes
        tensordict["action"] = torch.where(over, action, flown)
        return tensordict
