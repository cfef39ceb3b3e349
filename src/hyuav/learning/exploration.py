"""The noise that Algorithm 1 adds to the actor's action."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor


def as_planned(tensordict: TensorDictBase, planned: Tensor) -> TensorDictBase:
    """Take the planned actions (N, 2) in place of ``action``, where they are not NaN."""
    tensordict["action"] = torch.where(planned.isnan(), tensordict["action"], planned)
    return tensordict


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
        self.register_buffer("std", torch.full((learners, 1), variance**0.5, dtype=torch.float32))
        self.register_buffer("fresh", torch.ones(learners, 1, dtype=torch.bool))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``action`` (N, 2) and ``step_count`` (N, 1), write the noisy ``action``."""
        if self.decay_per == "slot":
            finished = ~self.fresh
        else:
            finished = ~self.fresh & (tensordict["step_count"] == 0)
        self.std.copy_(torch.where(finished, self.std * self.decay, self.std))
        self.fresh.fill_(False)
        action = tensordict["action"]
        noisy = action + self.std * torch.randn_like(action)
        tensordict["action"] = noisy.clamp(-1.0, 1.0)
        return tensordict
