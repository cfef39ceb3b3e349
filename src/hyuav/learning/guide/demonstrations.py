"""The best flight so far of each learner, to be flown again and to be joined."""

import torch
from torch import Tensor, nn

from hyuav.envs.observation import ObservationLayout
from hyuav.physics.scenario import Scenario


class Demonstrations(nn.Module):
    """The flight of each learner that earned most, or of which most is to be expected.

    The helper moves as it is told, so that the same actions lead it along the same trajectory,
    through other fading. One that was found once by chance is thus seen often enough to be learned
    of before it is forgotten, and chance is told from merit (Ecoffet et al., "First return, then
    explore", Nature 590, 2021). Beside it stands the planned one, to fly next; it may be another.

    Args:
        learners: N.
        scenario: that they fly.
        return_margin: share by which the best flight must be worth more than an actor's own for
            the actor to be behind.
    """

    best_return: Tensor
    """(N,), of each; minus infinity before the first."""
    actions: Tensor
    """(T, N, actions)."""
    trajectory: Tensor
    """(T, N, actions), where each was after each slot and at which power, as
    :meth:`hyuav.envs.observation.ObservationLayout.place` has it."""
    planned_actions: Tensor
    """(T, N, actions), of the flight to try."""
    planned_trajectory: Tensor
    """(T, N, actions), where that leads."""
    own_trajectory: Tensor
    """(T, N, actions), where the actors flew when they were last evaluated."""
    behind: Tensor
    """(N,) bool, of which learners the actor's own flight is worth clearly less than the best."""

    def __init__(self, learners: int, scenario: Scenario, return_margin: float) -> None:
        super().__init__()
        self._layout = ObservationLayout(scenario, clock=True)
        shape = scenario.num_slots, learners, self._layout.action_size
        self._return_margin = return_margin
        self._slots_per_unit = scenario.num_slots / 2
        self._reach = scenario.max_speed * scenario.slot_duration / (scenario.map_side / 2)
        self.register_buffer("best_return", torch.full((learners,), -torch.inf))
        for name in (
            *("actions", "trajectory", "planned_actions", "planned_trajectory"),
            "own_trajectory",
        ):
            self.register_buffer(name, torch.full(shape, torch.nan))
        self.register_buffer("behind", torch.zeros(learners, dtype=torch.bool))

    def keep(self, actions: Tensor, trajectory: Tensor, earned: Tensor) -> None:
        """Keep a flight where it is better than the best before.

        Args:
            actions: (T, N, actions).
            trajectory: (T, N, actions), where they led.
            earned: (N,), what it earned or what is to be expected of it.
        """
        better = earned > self.best_return
        self.best_return.copy_(torch.where(better, earned, self.best_return))
        for kept, new in ((self.actions, actions), (self.trajectory, trajectory)):
            kept.copy_(torch.where(better.unsqueeze(-1), new, kept))

    def plan_best(self) -> None:
        """Let the planned flight be the best one."""
        self.plan(self.actions, self.trajectory)

    def plan(self, actions: Tensor, trajectory: Tensor) -> None:
        """Let these actions, with the trajectory that they lead along, be planned."""
        self.planned_actions.copy_(actions)
        self.planned_trajectory.copy_(trajectory)

    def compare(self, own: Tensor) -> None:
        """Find out who is behind.

        Args:
            own: (N,), what the actors' own flights are worth, NaN where that is not known.
        """
        self.behind.copy_(self.best_return > own + self._return_margin * own.abs())

    def demonstrate(self, observation: Tensor) -> Tensor:
        """Actions (N, K, actions) that join the best flights by the next slot, or when possible.

        Their powers are those of the flights. Before there is one, they hover.

        Args:
            observation: (N, K, ...), with a clock.
        """
        clock = self._layout.clock(observation).squeeze(-1)
        flown = ((clock + 1.0) * self._slots_per_unit).round().long()
        size = self.trajectory.shape[-1]
        slot = flown.clamp(max=len(self.actions) - 1).unsqueeze(-1).expand(*flown.shape, size)
        place = torch.take_along_dim(self.trajectory.transpose(0, 1), slot, dim=1)
        position, power = self._layout.by_helper(place)
        own = self._layout.position(observation).view_as(position)
        action = self._layout.joined((position - own) / self._reach, power)
        return action.clamp(-1.0, 1.0).nan_to_num(0.0)

    def hover(self, observation: Tensor) -> Tensor:
        """Actions (N, K, actions) that stay, at the powers of :meth:`demonstrate`.

        Args:
            observation: (N, K, ...), with a clock.
        """
        velocity, power = self._layout.by_helper(self.demonstrate(observation))
        return self._layout.joined(torch.zeros_like(velocity), power)
