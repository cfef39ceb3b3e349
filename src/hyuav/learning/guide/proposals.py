"""Flights that were never flown, to be judged by what was learned of places."""

from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav.envs.observation import ObservationLayout
from hyuav.envs.transforms import WITHIN
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.warm_up import destinations, evenly
from hyuav.physics.slot import Physics


class TrajectoryProposals:
    """Flights to places all over the map, and variations of good ones.

    How the helper flies is known, and what a place earns is what a learner holds after all that it
    has seen; so flights can be judged before they are flown, as in Dyna (Sutton, "Integrated
    architectures for learning, planning, and reacting", ICML 1990). What was judged too well is
    found out by flying it. From episode to episode the places fill the map evenly; a variation
    displaces some slots in a row of a flight, by metres or by as far as can be flown in a slot.

    Args:
        guide: its parameters: D straight flights are imagined, and as many variations.
        physics: of the scenario that is flown.
        schemes: of the N learners.
    """

    def __init__(self, guide: Guide, physics: Physics, schemes: Sequence[str]) -> None:
        flights = guide.imagined_flights
        self._guide, self._physics = guide, physics
        self._places = torch.arange(flights, dtype=torch.float64, device=physics.device)
        limit = physics.norm_limit(schemes)
        self._norm_limit = None if limit is None else limit[:, None, :, None]
        self._learners, scenario = len(schemes), physics.scenario
        self._layout = ObservationLayout(scenario, clock=True)
        self._multiples = evenly(2 * scenario.num_helpers)
        self.normals = (flights, 3 + 2 * scenario.num_helpers)
        """Shape of the standard normal numbers that make the variations of one learner."""
        self._half_side = scenario.map_side / 2
        self._reach = scenario.max_speed * scenario.slot_duration / self._half_side

    def fly(self, episode: int, flights: Demonstrations, normals: Tensor) -> tuple[Tensor, Tensor]:
        """The flights of an episode; the first variation is the best flight itself.

        Args:
            episode: in which straight flights lead to other places than in those before.
            flights: which are varied, the best and the one that was planned last.
            normals: (N, D, 3 + 2 H), standard normal.

        Returns:
            the actions (T, N, 2 D, actions), and where they lead.
        """
        varied, powers = self._variations(flights, normals)
        towards = torch.cat([self._straight(episode), varied], dim=2)
        power = torch.cat([powers[:, :, :1].expand_as(powers), powers], dim=2)
        position = self._physics.nodes.helper.expand(*towards.shape[1:])
        actions, trajectory = [], []
        for target, own in zip(towards, power, strict=True):
            action = ((target - position / self._half_side) / self._reach).clamp(-1.0, 1.0)
            velocity = self._physics.velocity(action, self._norm_limit)
            position = self._physics.move(position, velocity).position
            actions.append(self._layout.joined(action, own))
            trajectory.append(self._layout.joined(position / self._half_side, own))
        return torch.stack(actions), torch.stack(trajectory)

    def _straight(self, episode: int) -> Tensor:
        """Where to fly in each slot: (T, N, D, H, 2)."""
        places = self._places + len(self._places) * episode
        share = torch.stack([torch.frac(places * each) for each in self._multiples], dim=-1)
        spread = self._guide.destination_spread
        ends = destinations(share.to(self._physics.dtype), spread) * WITHIN
        ends = ends.unflatten(-1, (-1, 2))
        return ends.expand(self._physics.scenario.num_slots, self._learners, *ends.shape)

    def _variations(self, flights: Demonstrations, normals: Tensor) -> tuple[Tensor, Tensor]:
        """The same of variations, and their powers (T, N, D, H, 1 or 0)."""
        varied = len(self._places)
        half = varied - varied // 2
        of_best = flights.trajectory.unsqueeze(2).expand(-1, -1, half, -1)
        of_planned = flights.planned_trajectory.unsqueeze(2).expand(-1, -1, varied // 2, -1)
        begin, length, fineness = torch.special.ndtr(normals[..., :3]).unbind(dim=-1)
        num_slots = len(flights.trajectory)
        slots = torch.arange(num_slots, device=normals.device).reshape(-1, 1, 1)
        first = (num_slots * (2.0 * begin - 1.0)).floor()  # below 0: from the beginning on
        displaced = (slots >= first) & (slots <= first.clamp(min=0.0) + num_slots * length)
        size = self._reach * self._guide.displacement_range**-fineness
        size[:, 0] = 0.0
        displacement = displaced.unsqueeze(-1) * (size.unsqueeze(-1) * normals[..., 3:])
        places = torch.cat([of_best, of_planned], dim=2)
        position, power = self._layout.by_helper(places)
        position = (position + displacement.view_as(position)).nan_to_num(0.0)
        return position.clamp(-WITHIN, WITHIN), power.nan_to_num(0.0)
