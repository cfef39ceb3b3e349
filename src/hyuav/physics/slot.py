"""The equations applied in order: what one slot brings, for any batch of flights."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics import channel, energy, motion, offloading, rates
from hyuav.physics.channel import LinkRow, Links
from hyuav.physics.layout import Nodes
from hyuav.physics.offloading import ModeRule
from hyuav.physics.scenario import Scenario
from hyuav.physics.tasks import Tasks


class Control(NamedTuple):
    """What the helpers do in a slot."""

    velocity: Tensor
    """(..., H, 2) m/s, within the limits that :meth:`Physics.velocity` keeps."""
    mode_rule: ModeRule = ModeRule(may_relay=True, must_relay=False)
    """Who chooses their modes; by default the better of both is taken."""
    power: Tensor | float = 1.0
    """(..., H), what they send at, in units of the nominal power of their mode."""


class ModeOutcome(NamedTuple):
    """What a slot brings in one mode of the helper."""

    sum_rate: Tensor
    """C_k, the secrecy sum-rate: (...) bps/Hz."""
    secrecy_rate: Tensor
    """[R^d_u - R^e_u]^+: (..., U) bps/Hz."""
    offloading: Tensor
    """z_u: (..., U) bool."""


class SlotOutcome(NamedTuple):
    """What a slot brings: where it leads, in both modes and in the chosen one."""

    nodes: Nodes
    """Where all nodes are in this slot."""
    control: Control
    """What the helpers did; the map's edge may have turned one back."""
    off_map: Tensor
    """(..., H) bool, the flight would have left the map and ended where it began."""
    distances: Tensor
    """(..., H, U + 1 + E) m, horizontal: from each helper to the UEs, L and the eavesdroppers."""
    relays: Tensor
    """(..., H) bool, which helpers relay; the others jam."""
    relay: ModeOutcome
    jamming: ModeOutcome
    scenario: Scenario
    """That is flown."""

    @property
    def sum_rate(self) -> Tensor:
        """The secrecy sum-rate in the chosen mode: (..., 1) bps/Hz."""
        return torch.where(
            self.relays, self.relay.sum_rate.unsqueeze(-1), self.jamming.sum_rate.unsqueeze(-1)
        )

    @property
    def offloading(self) -> Tensor:
        """z_u in the chosen mode: (..., U) bool."""
        return torch.where(self.relays, self.relay.offloading, self.jamming.offloading)

    @property
    def secrecy_rate(self) -> Tensor:
        """[R^d_u - R^e_u]^+ in the chosen mode: (..., U) bps/Hz."""
        return torch.where(self.relays, self.relay.secrecy_rate, self.jamming.secrecy_rate)

    @property
    def offloading_rate(self) -> Tensor:
        """The secrecy rate of the UEs that offload, 0 for the others: (..., U) bps/Hz."""
        return self.secrecy_rate * self.offloading

    @property
    def flight_energy(self) -> Tensor:
        """What flying takes: (..., H) J."""
        scenario = self.scenario
        return energy.flight_energy(
            self.control.velocity, scenario.helper_mass, scenario.slot_duration
        )

    @property
    def helper_transmission_energy(self) -> Tensor:
        """What relaying or jamming takes: (..., H) J."""
        scenario, power = self.scenario, self.control.power
        duration = scenario.slot_duration
        return torch.where(
            self.relays,
            energy.relay_energy(self.offloading, scenario.relay_power * power, duration),
            energy.jamming_energy(scenario.jamming_power * power, duration),
        )

    @property
    def ue_transmission_energy(self) -> Tensor:
        """What offloading takes the UEs that offload, 0 for the others: (..., U) J."""
        scenario = self.scenario
        of_mode = scenario.ue_power, scenario.slot_duration, scenario.num_ues
        relaying, jamming = (
            self.distances.new_full((), energy.offloading_energy(*of_mode, relay=relay))
            for relay in (True, False)
        )
        return torch.where(self.relays, relaying, jamming) * self.offloading


class StandingNodes(NamedTuple):
    """What follows from the nodes that do not move: UEs, L and eavesdroppers."""

    positions: Tensor
    """(..., 1, U + 1 + E, 2) m, beside the helpers' axis."""
    ue_to_legitimate: Tensor
    """Distances, (..., U) m."""
    legitimate_gain: Tensor
    """Path gains of the UEs' links to L, (..., U)."""
    eavesdropper_gain: Tensor
    """And to the eavesdroppers, (..., U, E)."""
    may_offload: Tensor
    """(..., U) bool: whom L covers and who can pay for sending while the helper jams."""


class Geometry(NamedTuple):
    """What follows from where all nodes are, before any fading."""

    distances: Tensor
    """(..., H, U + 1 + E) m, as in :class:`SlotOutcome`."""
    ue_to_helper: Tensor
    """Distances, (..., U, H) m."""
    standing: StandingNodes
    gains: Links
    """Path gains."""


class Physics:
    """The scenario's constants on a device.

    Args:
        scenario: node positions and parameters.
        device: of all tensors.
        dtype: float32 or float64.
        nodes: where the nodes are before the first slot, where that is not the scenario's layout
            alone; of the scenario's counts.
    """

    def __init__(
        self,
        scenario: Scenario,
        device: torch.device | str | None = None,
        dtype: torch.dtype = torch.float32,
        nodes: Nodes | None = None,
    ) -> None:
        self.scenario = scenario
        self.device = torch.device(device) if device is not None else torch.device("cpu")
        self.dtype = dtype
        self.nodes = Nodes.of(scenario, self.device, dtype) if nodes is None else nodes
        self.link_row = LinkRow.of(scenario)
        self.k_factor = self._k_factor()
        """Of all links, (link_row.size,), as power ratios."""
        self._pays_for_relaying = energy.ue_can_pay(scenario, relay=True)
        self.edge_can_saturate = energy.edge_can_saturate(scenario)
        """Whether the largest tasks of all UEs together would exceed the edge's budget E_L."""
        self._standing = self._stand(self.nodes)

    def _tensor(self, values: object) -> Tensor:
        return torch.tensor(values, dtype=self.dtype, device=self.device)

    def _k_factor(self) -> Tensor:
        ground = channel.k_factor_from_db(self.scenario.ground_to_air_k_factor)
        air = channel.k_factor_from_db(self.scenario.air_to_air_k_factor)
        factors = zip((ground, ground, ground, air, air), self.link_row.shapes, strict=True)
        links = Links(*(self._tensor(factor).expand(shape) for factor, shape in factors))
        return self.link_row.flatten(links)

    def _stand(self, nodes: Nodes) -> StandingNodes:
        scenario, ues = self.scenario, nodes.ue
        legitimate = nodes.legitimate.unsqueeze(-2)
        to_legitimate = channel.horizontal_distance(ues, legitimate)
        to_eavesdroppers = channel.horizontal_distance(
            ues.unsqueeze(-2), nodes.eavesdropper.unsqueeze(-3)
        )
        covered = offloading.covered_by_legitimate(to_legitimate, scenario.coverage_radius)
        groups = ues, legitimate, nodes.eavesdropper
        leading = torch.broadcast_shapes(*(group.shape[:-2] for group in groups))
        positions = [group.expand(*leading, *group.shape[-2:]) for group in groups]
        return StandingNodes(
            torch.cat(positions, dim=-2).unsqueeze(-3),
            to_legitimate,
            channel.ground_to_air(scenario, to_legitimate, scenario.altitude),
            channel.ground_to_air(scenario, to_eavesdroppers, scenario.eavesdropper_altitude),
            covered & energy.ue_can_pay(scenario, relay=False),
        )

    def standing(self, nodes: Nodes) -> StandingNodes:
        """What follows from the nodes that do not move; of the own layout it is known already."""
        own = self.nodes
        if (
            nodes.ue is own.ue
            and nodes.legitimate is own.legitimate
            and nodes.eavesdropper is own.eavesdropper
        ):
            return self._standing
        return self._stand(nodes)

    def distances(self, nodes: Nodes) -> Tensor:
        """From each helper to the UEs, to L and to the eavesdroppers: (..., H, U + 1 + E) m."""
        others = self.standing(nodes).positions
        return channel.horizontal_distance(nodes.helper.unsqueeze(-2), others)

    def by_role(self, distances: Tensor) -> tuple[Tensor, ...]:
        """The parts of :meth:`distances`: to the UEs (..., U), to L (..., 1), the rest (..., E)."""
        return distances.split((self.scenario.num_ues, 1, self.scenario.num_eavesdroppers), dim=-1)

    def geometry(self, nodes: Nodes) -> Geometry:
        """Distances and path gains (eq. 3 and 4 without fading) of all links."""
        scenario, standing = self.scenario, self.standing(nodes)
        distances = self.distances(nodes)
        to_ues, to_legitimate, to_eavesdroppers = self.by_role(distances)
        ue_to_helper = to_ues.mT
        climb = scenario.altitude - scenario.eavesdropper_altitude
        gains = Links(
            standing.legitimate_gain,
            channel.ground_to_air(scenario, ue_to_helper, scenario.altitude),
            standing.eavesdropper_gain,
            channel.air_to_air(scenario, to_legitimate.squeeze(-1), 0.0),
            channel.air_to_air(scenario, to_eavesdroppers, climb),
        )
        return Geometry(distances, ue_to_helper, standing, gains)

    def norm_limit(self, mode_rules: Sequence[str]) -> Tensor | None:
        """The bounds that :func:`hyuav.physics.motion.norm_limits` gives: (len(mode_rules), 1)."""
        limits = motion.norm_limits(self.scenario, mode_rules)
        return None if limits is None else self._tensor(limits).unsqueeze(-1)

    def velocity(self, action: Tensor, norm_limit: Tensor | None) -> Tensor:
        """The velocity (..., 2) m/s of an action (..., 2) in units of v_max, within the limits.

        ``norm_limit`` is what :meth:`norm_limit` gives, broadcast against the actions.
        """
        return motion.feasible_velocity(action, self.scenario.max_speed, norm_limit)

    def move(self, position: Tensor, velocity: Tensor) -> motion.Move:
        """Fly one slot from ``position`` (..., 2) m at ``velocity`` (..., 2) m/s."""
        scenario = self.scenario
        return motion.move(position, velocity, scenario.slot_duration, scenario.map_side)

    def draw_fading(self, shape: tuple[int, ...], generator: torch.Generator) -> Tensor | None:
        """One slot's fading powers in rows (*shape, size), as :class:`LinkRow` has them.

        None where fading is off.
        """
        if not self.scenario.fading:
            return None
        return channel.rician_power(self.k_factor, (*shape, self.link_row.size), generator)

    def relay_outcome(
        self,
        geometry: Geometry,
        gains: Links,
        tasks: Tasks | None,
        power: Tensor | float = 1.0,
    ) -> ModeOutcome:
        """The slot in relay mode.

        Args:
            geometry: of the slot's nodes.
            gains: with fading.
            tasks: needed where :attr:`edge_can_saturate`, and used nowhere else.
            power: as in :class:`Control`.
        """
        scenario = self.scenario
        achievable = rates.relay_rates(
            gains, scenario.ue_power, scenario.relay_power * power, scenario.noise_power
        )
        covered = offloading.covered_by_relay(
            geometry.ue_to_helper.squeeze(-1),
            geometry.standing.ue_to_legitimate,
            scenario.coverage_radius,
        )
        return self._outcome(achievable, covered & self._pays_for_relaying, tasks)

    def jamming_outcome(
        self,
        geometry: Geometry,
        gains: Links,
        tasks: Tasks | None,
        power: Tensor | float = 1.0,
    ) -> ModeOutcome:
        """The slot in jamming mode; as :meth:`relay_outcome`."""
        scenario = self.scenario
        achievable = rates.jamming_rates(
            gains, scenario.ue_power, scenario.jamming_power * power, scenario.noise_power
        )
        return self._outcome(achievable, geometry.standing.may_offload, tasks)

    def _outcome(
        self, achievable: rates.AchievableRates, allowed: Tensor, tasks: Tasks | None
    ) -> ModeOutcome:
        scenario = self.scenario
        rate = rates.secrecy_rate(achievable)
        decision = offloading.offloading_decision(rate, allowed, scenario.min_secrecy_rate)
        if self.edge_can_saturate:
            if tasks is None:
                raise ValueError("tasks: expected, because they can fill the edge server")
            decision = offloading.admitted_by_edge(
                decision,
                rate,
                tasks.cpu_cycles,
                scenario.capacitance,
                scenario.slot_duration,
                scenario.edge_energy_budget,
            )
        return ModeOutcome(rates.secrecy_sum_rate(rate, decision), rate, decision)


def slot(
    physics: Physics,
    nodes: Nodes,
    control: Control,
    fading: Links | None = None,
    tasks: Tasks | None = None,
) -> SlotOutcome:
    """One slot of any batch of flights: lines 6 to 11 of Algorithm 1.

    The helpers fly, then the channel is known: who offloads, and what it brings, in both modes
    (eq. 3 to 6, 8c to 8f and 11), and the mode that is chosen.

    Args:
        physics: the scenario's constants.
        nodes: where all are before the slot, such as :attr:`Physics.nodes`.
        control: what the helpers do.
        fading: powers of all links; None for no fading.
        tasks: of the UEs; needed where :attr:`Physics.edge_can_saturate`.

    Raises:
        ValueError: no tasks are given though they can fill the edge server.

    Example:
        >>> physics = Physics(Scenario.preset("two_clusters"))
        >>> northeast = Control(torch.full((1, 2), 20.0))
        >>> slot(physics, physics.nodes, northeast).nodes.helper
        tensor([[-40., -40.]])
    """
    moved = physics.move(nodes.helper, control.velocity)
    nodes = nodes._replace(helper=moved.position)
    geometry = physics.geometry(nodes)
    gains = geometry.gains.faded(fading)
    relay = physics.relay_outcome(geometry, gains, tasks, control.power)
    jamming = physics.jamming_outcome(geometry, gains, tasks, control.power)
    relays = offloading.chooses_relay(relay.sum_rate, jamming.sum_rate, control.mode_rule)
    return SlotOutcome(
        nodes,
        control,
        moved.off_map,
        geometry.distances,
        relays,
        relay,
        jamming,
        physics.scenario,
    )
