"""Where an action leads: what is known of a slot before it is flown."""

import torch
from torch import Tensor, nn

from hyuav.envs.observation import ObservationLayout
from hyuav.envs.transforms import fenced
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics


class Afterstate(nn.Module):
    """The state between an action and its slot's fading (Sutton and Barto, 2018, section 6.8).

    How the helper flies is known, how it earns is not. The reward and all that follows depend on
    where the action leads alone, and on the slots that are left; so this is what a critic needs to
    see, instead of a position and a velocity whose sum it would have to learn. Which UEs are
    covered there changes the reward in steps a few metres apart, too narrow to be learned from
    distances; so coverage is shown as well, as a tanh of the distance to its edge.

    Where the budget E_H bounds the speed, it is the hybrid scheme's bound that counts.

    Args:
        scenario: its nodes, speed limit and map.
        coverage_blur: how wide the edge of the coverage is shown, as a share of the map's side.
        clock: whether the slots flown are observed.
        geofence: whether flights are slowed to end on the map.
    """

    def __init__(
        self, scenario: Scenario, coverage_blur: float, *, clock: bool, geofence: bool
    ) -> None:
        super().__init__()
        self._blur = coverage_blur * scenario.map_side
        self._physics = Physics(scenario, torch.get_default_device())
        limit = self._physics.norm_limit(["hybrid"])
        self._norm_limit = None if limit is None else limit[0].unsqueeze(-1)
        self.layout = ObservationLayout(scenario, clock=clock)
        self._clock, self._geofence = clock, geofence
        self.num_helpers, self.num_ues = scenario.num_helpers, scenario.num_ues
        powers = self.num_helpers * scenario.power_control
        self.size = self.layout.size + self.num_helpers * self.num_ues + powers

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Map observations (..., observed) and actions (..., actions) to features (..., size).

        In order: the positions of the helpers, their distances to the UEs, L and the
        eavesdroppers, each one's coverage of each UE, whether it left the map (1, otherwise -1),
        its power where that is controlled, and with a clock the slots flown; all of order one.
        """
        scenario = self._physics.scenario
        half_side = scenario.map_side / 2
        position = self.layout.position(observation).unflatten(-1, (self.num_helpers, 2))
        position = position * half_side
        velocity, power = self.layout.by_helper(action)
        if self._geofence:
            velocity = fenced(scenario, position, velocity)
        moved = self._physics.move(position, self._physics.velocity(velocity, self._norm_limit))
        beside = moved.off_map.to(position.dtype) * 2.0 - 1.0
        return self._features(moved.position, beside, power, self.layout.clock(observation))

    def at(self, place: Tensor, clock: Tensor) -> Tensor:
        """The features (..., size) of having flown somewhere on the map.

        Args:
            place: (..., actions), as :meth:`hyuav.envs.observation.ObservationLayout.place` has it.
            clock: (..., 1), what the clock shows; without one it does not matter.
        """
        position, power = self.layout.by_helper(place)
        position = position * (self._physics.scenario.map_side / 2)
        beside = torch.full_like(position[..., 0], -1.0)
        return self._features(position, beside, power, clock)

    def coverage(self, features: Tensor) -> Tensor:
        """How far each helper covers each UE, from 0 to 1: (..., H U), of features (..., F)."""
        first = self.num_helpers * (2 + self.layout.num_distances)
        shown = features[..., first : first + self.num_helpers * self.num_ues]
        return 0.5 * (shown + 1.0)

    def _features(self, position: Tensor, beside: Tensor, power: Tensor, clock: Tensor) -> Tensor:
        scenario = self._physics.scenario
        half_side = scenario.map_side / 2
        nodes = self._physics.nodes._replace(helper=position)
        distances = self._physics.distances(nodes)
        inside = scenario.coverage_radius - self._physics.by_role(distances)[0]
        features = [
            (position / half_side).flatten(-2),
            (distances / half_side - 1.0).flatten(-2),
            torch.tanh(inside / self._blur).flatten(-2),
            beside,
            power.flatten(-2),
        ]
        return torch.cat([*features, clock] if self._clock else features, dim=-1)
