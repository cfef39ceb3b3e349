"""The noise that Algorithm 1 adds to the actor's action, and what may come before it."""

import math

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

PERSISTENCE, LARGEST_VIGOUR = 0.97, 4.0
"""Correlation of a warm-up's consecutive actions, and their size before they are clipped."""

EVENLY = (0.7548776662466927, 0.5698402909980532)
"""Multiples of both fill the unit square evenly (Roberts, "The unreasonable effectiveness of
quasirandom sequences", 2018)."""


class GaussianNoise(TensorDictModuleBase):
    """Add zero-mean Gaussian noise to ``action`` and clip it to [-1, 1]; the noise decays.

    The standard deviation, in units of v_max, starts at the square root of ``variance`` and is
    multiplied by ``decay`` after every slot, or after every episode.

    Args:
        learners: N; each learner's noise is drawn and decays on its own.
        variance: of the noise in the first slot, in units of v_max squared.
        decay: factor of the standard deviation.
        decay_per: "slot" or "episode".
        floor: that the standard deviation does not fall below.
    """

    in_keys = ("action", "step_count")
    out_keys = ("action",)

    def __init__(
        self, learners: int, variance: float, decay: float, decay_per: str, floor: float = 0.0
    ) -> None:
        super().__init__()
        self.decay, self.decay_per, self.floor = decay, decay_per, floor
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
        noisy = action + self.std.clamp(min=self.floor) * torch.randn_like(action)
        tensordict["action"] = noisy.clamp(-1.0, 1.0)
        return tensordict


class WarmUp(TensorDictModuleBase):
    """Fly at random for some episodes, whatever ``action`` says: hovering, roaming or sweeping.

    An action is an autoregressive Gaussian process of unit variance times the episode's vigour,
    and clipped. The direction in which an episode begins and the root of its vigour, up to
    :data:`LARGEST_VIGOUR`, fill their ranges evenly from episode to episode: at the least vigour
    the helper stays about the start, at the most it crosses the map at full speed. Each learner
    draws where in this sequence it begins, so that the directions cover the circle whatever the
    seed, and in an order of its own. Independent actions would only tremble about the start.

    Args:
        learners: N; each flies its own way.
        episodes: to fly so.
    """

    in_keys = ("action", "step_count")
    out_keys = ("action",)

    def __init__(self, learners: int, episodes: int) -> None:
        super().__init__()
        self._episodes = episodes
        self.register_buffer("heading", torch.zeros(learners, 2))
        self.register_buffer("origin", torch.zeros(learners, 2))
        self.register_buffer("episode", torch.zeros(learners, 1))
        self.register_buffer("multiples", torch.tensor(EVENLY), persistent=False)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``action`` (N, 2) and ``step_count`` (N, 1), write the ``action`` to take."""
        action, begins = tensordict["action"], tensordict["step_count"] == 0
        normal = torch.randn_like(action)
        anywhere = torch.special.ndtr(normal)
        self.origin.copy_(torch.where(begins & (self.episode == 0), anywhere, self.origin))
        self.episode.add_(begins)
        turned = PERSISTENCE * self.heading + (1.0 - PERSISTENCE**2) ** 0.5 * normal
        share, part = torch.frac(self.origin + self.episode * self.multiples).split(1, dim=-1)
        angle = 2.0 * math.pi * part
        begun = math.sqrt(2.0) * torch.cat([angle.cos(), angle.sin()], dim=-1)
        self.heading.copy_(torch.where(begins, begun, turned))
        vigour = LARGEST_VIGOUR * share.square()
        roaming = (vigour * self.heading).clamp(-1.0, 1.0)
        tensordict["action"] = torch.where(self.episode > self._episodes, action, roaming)
        return tensordict
