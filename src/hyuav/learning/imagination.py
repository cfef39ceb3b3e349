"""Flights that were never flown, and what is to be expected of them."""

from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav.envs.transforms import WITHIN
from hyuav.learning.control_variate import ControlVariate
from hyuav.learning.exploration import EVENLY, destinations
from hyuav.learning.repetition import BestFlights
from hyuav.system import SecureOffloadingSystem


class Imagination:
    """Flights to places all over the map, the best of which are worth trying.

    How the helper flies is known, and what a place earns is what a learner's regression holds
    after all that it has seen; so flights can be judged before they are flown, as in Dyna (Sutton,
    "Integrated architectures for learning, planning, and reacting", ICML 1990). What was judged
    too well is found out by flying it. From episode to episode the places fill the map evenly.

    Args:
        flights: D, of which the best is looked for at once.
        system: that is flown.
        schemes: of the N learners.
    """

    def __init__(
        self, flights: int, system: SecureOffloadingSystem, schemes: Sequence[str]
    ) -> None:
        self._system = system
        self._places = torch.arange(flights, dtype=torch.float64, device=system.device)
        limit = system.norm_limit(schemes)
        self._norm_limit = None if limit is None else limit.unsqueeze(1)
        self._learners = len(schemes)

    def improve(self, best: BestFlights, variate: ControlVariate, episode: int) -> None:
        """Let an imagined flight be the best where more is to be expected of it.

        Args:
            best: of each learner.
            variate: which has learned what to expect.
            episode: in which others are imagined than in those before.
        """
        actions, way = self.fly(episode)
        expected, chosen = variate.expected(way).max(dim=1)
        index = chosen[None, :, None, None].expand(len(way), -1, 1, 2)
        taken = torch.take_along_dim(actions, index, dim=2).squeeze(2)
        best.keep(taken, torch.take_along_dim(way, index, dim=2).squeeze(2), expected)

    def fly(self, episode: int) -> tuple[Tensor, Tensor]:
        """The flights of an episode.

        Returns:
            the actions (T, N, D, 2), and where they lead, in units of half the map's side.
        """
        scenario = self._system.scenario
        half_side = scenario.map_side / 2
        reach = scenario.max_speed * scenario.slot_duration
        places = self._places + len(self._places) * episode
        share = torch.stack([torch.frac(places * multiple) for multiple in EVENLY], dim=-1)
        destination = destinations(share.to(self._system.dtype)) * (half_side * WITHIN)
        position = self._system.helper_start.expand(self._learners, len(places), 2)
        actions, way = [], []
        for _ in range(scenario.num_slots):
            action = ((destination - position) / reach).clamp(-1.0, 1.0)
            position = self._system.move(position, action, self._norm_limit).position
            actions.append(action.expand(position.shape))
            way.append(position / half_side)
        return torch.stack(actions), torch.stack(way)
