"""The best flight so far of each learner, to be flown again and to be joined."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from hyuav.envs.observation import ObservationLayout
from hyuav.physics.scenario import Scenario


def as_planned(tensordict: TensorDictBase, planned: Tensor) -> TensorDictBase:
    """Take the planned actions (N, 2) in place of ``action``, where they are not NaN."""
    tensordict["action"] = torch.where(planned.isnan(), tensordict["action"], planned)
    return tensordict


AHEAD = 0.005
"""Share by which the best flight must be worth more than an actor's own to be joined everywhere."""


class BestFlights(nn.Module):
    """The flight of each learner that earned most, or of which most is to be expected.

    The helper moves as it is told, so that the same actions lead it the same way, through other
    fading. A way that was found once by chance is thus seen often enough to be learned of before
    it is forgotten, and luck is told from merit (Ecoffet et al., "First return, then explore",
    Nature 590, 2021). Beside it stands the one to try next, which may be another.

    Args:
        learners: N.
        scenario: that they fly.
    """

    reward: Tensor
    """(N,), of each; minus infinity before the first."""
    actions: Tensor
    """(T, N, 2)."""
    way: Tensor
    """(T, N, 2), where each was after each slot, in units of half the map's side."""
    tried_actions: Tensor
    """(T, N, 2), of the one to try."""
    tried_way: Tensor
    """(T, N, 2), where that leads."""
    own_way: Tensor
    """(T, N, 2), where the actors flew when they were last evaluated."""
    behind: Tensor
    """(N,) bool, of which learners the actor's own flight is worth clearly less than the best."""

    def __init__(self, learners: int, scenario: Scenario) -> None:
        super().__init__()
        shape = scenario.num_slots, learners, 2
        self._layout = ObservationLayout(scenario, clock=True)
        self._slots_per_unit = scenario.num_slots / 2
        self._reach = scenario.max_speed * scenario.slot_duration / (scenario.map_side / 2)
        self.register_buffer("reward", torch.full((learners,), -torch.inf))
        for name in ("actions", "way", "tried_actions", "tried_way", "own_way"):
            self.register_buffer(name, torch.full(shape, torch.nan))
        self.register_buffer("behind", torch.zeros(learners, dtype=torch.bool))

    def keep(self, actions: Tensor, way: Tensor, reward: Tensor) -> None:
        """Keep a flight where it is better than the best before.

        Args:
            actions: (T, N, 2).
            way: (T, N, 2), where they led.
            reward: (N,), what it earned or what is to be expected of it.
        """
        better = reward > self.reward
        self.reward.copy_(torch.where(better, reward, self.reward))
        for kept, new in ((self.actions, actions), (self.way, way)):
            kept.copy_(torch.where(better.unsqueeze(-1), new, kept))

    def try_best(self) -> None:
        """Let the flight to try be the best one."""
        self.try_next(self.actions, self.way)

    def try_next(self, actions: Tensor, way: Tensor) -> None:
        """Let these actions, which lead this way, be the flight to try: (T, N, 2) each."""
        self.tried_actions.copy_(actions)
        self.tried_way.copy_(way)

    def compare(self, own: Tensor) -> None:
        """Find out who is behind.

        Args:
            own: (N,), what the actors' own flights are worth, NaN where that is not known.
        """
        self.behind.copy_(self.reward > own + AHEAD * own.abs())

    def towards(self, observation: Tensor) -> Tensor:
        """Actions (N, K, 2) that join the best flights by the next slot, or as soon as possible.

        Before there is one, they hover.

        Args:
            observation: (N, K, ...), with a clock.
        """
        clock = self._layout.clock(observation).squeeze(-1)
        flown = ((clock + 1.0) * self._slots_per_unit).round().long()
        slot = flown.clamp(max=len(self.actions) - 1).unsqueeze(-1).expand(*flown.shape, 2)
        position = torch.take_along_dim(self.way.transpose(0, 1), slot, dim=1)
        action = (position - self._layout.position(observation)) / self._reach
        return action.clamp(-1.0, 1.0).nan_to_num(0.0)
