"""The noise that Algorithm 1 adds to the actor's action, and what may come before it."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.physics.scenario import Scenario

BEYOND = 1.25
"""Where destinations are drawn, in units of the map; those beyond it are brought to its edge."""

JITTER = 0.1
"""Standard deviation of a warm-up's noise, in units of v_max."""

EVENLY = (0.7548776662466927, 0.5698402909980532)
"""Multiples of both fill the unit square evenly (Roberts, "The unreasonable effectiveness of
quasirandom sequences", 2018)."""


def destinations(share: Tensor) -> Tensor:
    """Places all over the map, its edges more densely, in units of half the map's side.

    Args:
        share: (..., 2) in [0, 1).
    """
    return ((2.0 * share - 1.0) * BEYOND).clamp(-1.0, 1.0)


class GaussianNoise(TensorDictModuleBase):
    """Add zero-mean Gaussian noise to ``action`` and clip it to [-1, 1]; the noise decays.

    The standard deviation, in units of v_max, starts at the square root of ``variance`` and is
    multiplied by ``decay`` after every slot, or after every episode.

    Args:
        learners: N; each learner's noise is drawn and decays on its own.
        variance: of the noise in the first slot, in units of v_max squared.
        decay: factor of the standard deviation.
        decay_per: "slot" or "episode".
    """

    in_keys = ("action", "step_count")
    out_keys = ("action",)

    def __init__(self, learners: int, variance: float, decay: float, decay_per: str) -> None:
        super().__init__()
        self.decay, self.decay_per = decay, decay_per
        self.register_buffer("std", torch.full((learners, 1), variance**0.5))
        self.register_buffer("fresh", torch.ones(learners, 1, dtype=torch.bool))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``action`` (N, 2) and ``step_count`` (N, 1), write the noisy ``action``."""
        if self.decay_per == "slot":
            finished = ~self.fresh
        else:
            finished = ~self.fresh & (tensordict["step_count"] == 0)
        self.std.mul_(torch.where(finished, self.decay, 1.0))
        self.fresh.fill_(False)
        action = tensordict["action"]
        noisy = action + self.std * torch.randn_like(action)
        tensordict["action"] = noisy.clamp(-1.0, 1.0)
        return tensordict


class WarmUp(TensorDictModuleBase):
    """Fly to places all over the map and stay there, for some episodes, whatever ``action`` says.

    The best flights go somewhere and hover. Noise about an actor never leaves the start's
    surroundings, where a far region takes many slots in one direction and little is earned on the
    way. From episode to episode the destinations fill the map evenly, and its edges more densely;
    each learner draws where in their sequence it begins, so that they cover the map whatever the
    seed, and in an order of its own. A little noise shows what is beside the way.

    Args:
        learners: N; each flies its own way.
        episodes: to fly so.
        scenario: its map and speed.
    """

    in_keys = ("action", "step_count", "position")
    out_keys = ("action",)

    def __init__(self, learners: int, episodes: int, scenario: Scenario) -> None:
        super().__init__()
        self._episodes, self._half_side = episodes, scenario.map_side / 2
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
        destination = destinations(share) * self._half_side
        towards = (destination - tensordict["position"].flatten(-2)) / self._reach
        flown = (towards + JITTER * normal).clamp(-1.0, 1.0)
        tensordict["action"] = torch.where(self.episode > self._episodes, action, flown)
        return tensordict
