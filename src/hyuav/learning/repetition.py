"""The best flight so far of each learner, to be flown again and to be followed."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.scenario import Scenario


def as_planned(tensordict: TensorDictBase, planned: Tensor) -> TensorDictBase:
    """Take the planned actions (N, 2) in place of ``action``, where they are not NaN."""
    tensordict["action"] = torch.where(planned.isnan(), tensordict["action"], planned)
    return tensordict


class BestFlights(nn.Module):
    """What each learner did in the episode in which it earned most.

    The helper moves as it is told, so that the same actions lead it the same way, through other
    fading. A way that was found once by chance is thus seen often enough to be learned of before
    it is forgotten, and luck is told from merit (Ecoffet et al., "First return, then explore",
    Nature 590, 2021).

    Args:
        learners: N.
        scenario: that they fly.
        size: of an observation, U + 5 or U + 6.
    """

    reward: Tensor
    """(N,), what each earned; minus infinity before the first."""
    actions: Tensor
    """(T, N, 2)."""
    observations: Tensor
    """(T, N, U + 6), what each saw after each slot."""

    def __init__(self, learners: int, scenario: Scenario, size: int) -> None:
        super().__init__()
        shape = scenario.num_slots, learners, 2
        self._slots_per_unit = scenario.num_slots / 2
        self._reach = scenario.max_speed * scenario.slot_duration / (scenario.map_side / 2)
        self.register_buffer("reward", torch.full((learners,), -torch.inf))
        self.register_buffer("actions", torch.full(shape, torch.nan))
        self.register_buffer("observations", torch.full((*shape[:2], size), torch.nan))

    def keep(self, flown: TensorDictBase, reward: Tensor) -> None:
        """Keep the flight of an episode where it earned more than any before.

        Args:
            flown: its slots (T, N).
            reward: (N,) that it earned.
        """
        better = reward > self.reward
        self.reward.copy_(torch.where(better, reward, self.reward))
        where = better.unsqueeze(-1)
        self.actions.copy_(torch.where(where, flown["action"], self.actions))
        following = flown["next", "observation"]
        self.observations.copy_(torch.where(where, following, self.observations))

    def towards(self, observation: Tensor) -> Tensor:
        """Actions (N, K, 2) that join the best flights by the next slot, or as soon as possible.

        Before there is one, they hover.

        Args:
            observation: (N, K, U + 6), with a clock.
        """
        flown = ((observation[..., -1] + 1.0) * self._slots_per_unit).round().long()
        slot = flown.clamp(max=len(self.actions) - 1).unsqueeze(-1).expand(*flown.shape, 2)
        way = self.observations[..., :2].transpose(0, 1)
        position = torch.take_along_dim(way, slot, dim=1)
        action = (position - observation[..., :2]) / self._reach
        return action.clamp(-1.0, 1.0).nan_to_num(0.0)
