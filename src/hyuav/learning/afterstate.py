"""Where an action leads: what is known of a slot before it is flown."""

import torch
from torch import Tensor, nn

from hyuav._support.errors import InputError, rejection
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

    Where the budget E_H bounds the speed, it is the hybrid scheme's bound that counts. It is for
    one helper at its nominal power.

    Args:
        scenario: its nodes, speed limit and map.
        coverage_blur: how wide the edge of the coverage is shown, as a share of the map's side.
        clock: whether the slots flown are observed.
        geofence: whether flights are slowed to end on the map.

    Raises:
        InputError: there are several helpers, or their power is controlled.
    """

    def __init__(
        self, scenario: Scenario, coverage_blur: float, *, clock: bool, geofence: bool
    ) -> None:
        super().__init__()
        if scenario.num_helpers > 1 or scenario.power_control:
            accepted = "false with several helpers or power control: it knows one helper's flight"
            raise InputError(rejection("afterstate", True, accepted))
        self._blur = coverage_blur * scenario.map_side
        self._physics = Physics(scenario, torch.get_default_device())
        self._norm_limit = self._physics.norm_limit(["hybrid"])
        self.layout = ObservationLayout(scenario, clock=clock)
        self._clock, self._geofence = clock, geofence
        self.num_ues = scenario.num_ues
        self.size = self.layout.size + self.num_ues

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Map observations and actions (..., 2) to features (..., size).

        In order: the position, the distances to the UEs, L and E, the coverage of each UE, and
        whether the map was left (1, otherwise -1), and with a clock the slots flown; all of order
        one.
        """
        scenario = self._physics.scenario
        position = self.layout.position(observation) * (scenario.map_side / 2)
        if self._geofence:
            action = fenced(scenario, position, action)
        moved = self._physics.move(position, self._physics.velocity(action, self._norm_limit))
        beside = moved.off_map.unsqueeze(-1).to(position.dtype) * 2.0 - 1.0
        return self._features(moved.position, beside, self.layout.clock(observation))

    def at(self, place: Tensor, clock: Tensor) -> Tensor:
        """The features (..., size) of having flown somewhere on the map.

        Args:
            place: (..., 2) in units of half the map's side.
            clock: (..., 1), what the clock shows; without one it does not matter.
        """
        position = place * (self._physics.scenario.map_side / 2)
        return self._features(position, torch.full_like(clock, -1.0), clock)

    def coverage(self, features: Tensor) -> Tensor:
        """How far the helper covers each UE there, from 0 to 1: (..., U), of features (..., F)."""
        first = 2 + self.layout.num_distances
        shown = features[..., first : first + self.num_ues]
        return 0.5 * (shown + 1.0)

    def _features(self, position: Tensor, beside: Tensor, clock: Tensor) -> Tensor:
        scenario = self._physics.scenario
        half_side = scenario.map_side / 2
        nodes = self._physics.nodes._replace(helper=position.unsqueeze(-2))
        distances = self._physics.distances(nodes).squeeze(-2)
        inside = scenario.coverage_radius - self._physics.by_role(distances)[0]
        features = [
            position / half_side,
            distances / half_side - 1.0,
            torch.tanh(inside / self._blur),
            beside,
        ]
        return torch.cat([*features, clock] if self._clock else features, dim=-1)
