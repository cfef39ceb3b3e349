"""Flights to places all over the map, before anything is known of them."""

import math

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.envs.observation import ObservationLayout
from hyuav.learning.guide.parameters import Guide
from hyuav.physics.scenario import Scenario


def evenly(dimensions: int) -> list[float]:
    """Numbers whose multiples, of all together, fill the unit cube of so many dimensions evenly.

    They are the powers of 1 / x, where x^(dimensions + 1) = x + 1 (Roberts, "The unreasonable
    effectiveness of quasirandom sequences", 2018).
    """
    root = 2.0
    for _ in range(50):  # Newton's method; by products alone, which all machines round alike
        power = math.prod([root] * dimensions)
        root -= (power * root - root - 1.0) / ((dimensions + 1) * power - 1.0)
    return [1.0 / math.prod([root] * (count + 1)) for count in range(dimensions)]


def destinations(share: Tensor, spread: float) -> Tensor:
    """Places all over the map, its edges more densely, in units of half the map's side.

    Args:
        share: (..., coordinates) in [0, 1).
        spread: where they are drawn, in units of the map; those beyond it are brought to its edge.
    """
    return ((2.0 * share - 1.0) * spread).clamp(-1.0, 1.0)


class WarmUp(TensorDictModuleBase):
    """Fly to places all over the map and stay there, for some episodes, whatever ``action`` says.

    The best flights go somewhere and hover. Noise about an actor never leaves the start's
    surroundings, where a far region takes many slots in one direction and little is earned on the
    way. From episode to episode the destinations fill the map evenly, and its edges more densely;
    each learner draws where in their sequence it begins, so that they cover the map whatever the
    seed, and in an order of its own. A little noise shows what is beside the trajectory. Each
    helper has destinations of its own, and where its power is controlled, that is drawn anew in
    each slot, evenly in dB.

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
        self._layout = ObservationLayout(scenario, clock=True)
        coordinates = 2 * scenario.num_helpers
        self.register_buffer("origin", torch.zeros(learners, coordinates))
        self.register_buffer("episode", torch.zeros(learners, 1))
        self.register_buffer("multiples", torch.tensor(evenly(coordinates)), persistent=False)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``action``, ``step_count`` (N, 1) and ``position`` (N, H, 2) m; act."""
        action, begins = tensordict["action"], tensordict["step_count"] == 0
        normal, for_power = self._layout.by_helper(torch.randn_like(action))
        anywhere = torch.special.ndtr(normal).flatten(-2)
        self.origin.copy_(torch.where(begins & (self.episode == 0), anywhere, self.origin))
        self.episode.add_(begins)
        share = torch.frac(self.origin + self.episode * self.multiples)
        destination = destinations(share, self._guide.destination_spread) * self._half_side
        towards = (destination.view_as(normal) - tensordict["position"]) / self._reach
        velocity = (towards + self._guide.warm_up_noise * normal).clamp(-1.0, 1.0)
        power = 2.0 * torch.special.ndtr(for_power) - 1.0
        flown = self._layout.joined(velocity, power)
        over = self.episode > self._guide.warm_up_episodes
        tensordict["action"] = torch.where(over, action, flown)
        return tensordict
