"""The best flight so far of each learner, to be flown again."""

from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import ReplayBuffer


def as_planned(tensordict: TensorDictBase, planned: Tensor) -> TensorDictBase:
    """Take the planned actions (N, 2) in place of ``action``, where they are not NaN."""
    tensordict["action"] = torch.where(planned.isnan(), tensordict["action"], planned)
    return tensordict


class BestFlights:
    """What each learner did in the episode in which it earned most.

    The helper moves as it is told, so that the same actions lead it the same way, through other
    fading. A way that was found once by chance is thus seen often enough to be learned of before
    it is forgotten, and luck is told from merit (Ecoffet et al., "First return, then explore",
    Nature 590, 2021).

    Args:
        learners: N.
        num_slots: T.
        device: of all tensors.
    """

    def __init__(self, learners: int, num_slots: int, device: torch.device | None) -> None:
        self.reward = torch.full((learners,), -torch.inf, device=device)
        self.actions = torch.full((num_slots, learners, 2), torch.nan, device=device)

    def keep(self, reward: Tensor, replay: ReplayBuffer) -> None:
        """Keep the flight whose slots were stored last where it earned more than any before.

        Args:
            reward: (N,) bps/Hz that it earned.
            replay: of capacity T at least.
        """
        count = len(self.actions)
        first = replay.writer._cursor - count
        slots = torch.arange(first, first + count) % replay.storage.max_size
        better = reward > self.reward
        flown = replay.storage._storage["action"][slots]
        self.actions = torch.where(better.unsqueeze(-1), flown, self.actions)
        self.reward = torch.where(better, reward, self.reward)

    def state(self) -> dict[str, Tensor]:
        """Everything that evolves."""
        return {"reward": self.reward, "actions": self.actions}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from where :meth:`state` was taken."""
        self.reward = state["reward"].to(self.reward.device)
        self.actions = state["actions"].to(self.actions.device)
