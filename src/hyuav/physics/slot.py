"""The equations applied in order: what one slot brings, for any batch of flights."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics import channel, energy, modes, motion, offloading, rates
from hyuav.physics.channel import LinkRow, Links
from hyuav.physics.layout import Nodes
from hyuav.physics.modes import ModeRule
from hyuav.physics.outcome import Control, ModeOutcome, SlotOutcome
from hyuav.physics.prospects import warn_of_what_cannot_earn
from hyuav.physics.scenario import Scenario, as_scenario
from hyuav.physics.tasks import Tasks


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
    covered: Tensor
    """(..., U) bool: whom L covers."""
    may_send: Tensor
    """(..., U) bool: whom L covers and who can pay for sending straight to it."""
    may_be_relayed: Tensor
    """(..., U) bool: whom L covers and who can pay for sending to a relay."""


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
        scenario: node positions and parameters, or the name of a preset.
        device: of all tensors.
        dtype: float32 or float64.
        nodes: where the nodes are before the first slot, where that is not the scenario's layout
            alone; of the scenario's counts.
        layout_is_known: False where layouts are drawn, and these nodes are only an example.

    Warns:
        ScenarioWarning: a mode can never earn anything; once in a process.
    """

    def __init__(
        self,
        scenario: Scenario | str,
        device: torch.device | str | None = None,
        dtype: torch.dtype = torch.float32,
        nodes: Nodes | None = None,
        *,
        layout_is_known: bool = True,
    ) -> None:
        self.scenario = scenario = as_scenario(scenario)
        self.device = torch.device(device) if device is not None else torch.device("cpu")
        self.dtype = dtype
        self.nodes = Nodes.of(scenario, self.device, dtype) if nodes is None else nodes
        self._counts = scenario.num_ues, 1, scenario.num_eavesdroppers
        self.link_row = LinkRow.of(scenario)
        self.k_factor = self._k_factor()
        """Of all links, (link_row.size,), as power ratios."""
        self._no_links = self._tensor([])
        # Tensors, since PyTorch reckons with them faster than with numbers of Python.
        self._sent = self._nominal()
        self._coverage_radius = self._tensor(scenario.coverage_radius)
        self._min_secrecy_rate = self._tensor(scenario.min_secrecy_rate)
        self.mode_vectors = [
            torch.tensor(vector, device=self.device)
            for vector in modes.mode_vectors(scenario.num_helpers)
        ]
        """What :func:`hyuav.physics.modes.mode_vectors` lists, each (H,) bool."""
        self.edge_can_saturate = energy.edge_can_saturate(scenario)
        """Whether the largest tasks of all UEs together would exceed the edge's budget E_L."""
        self._standing = self._stand(self.nodes)
        known = self._standing.ue_to_legitimate if layout_is_known else None
        warn_of_what_cannot_earn(scenario, known)

    def _tensor(self, values: object) -> Tensor:
        return torch.tensor(values, dtype=self.dtype, device=self.device)

    def _k_factor(self) -> Tensor:
        ground = channel.k_factor_from_db(self.scenario.ground_to_air_k_factor)
        air = channel.k_factor_from_db(self.scenario.air_to_air_k_factor)
        of_links = (ground, ground, ground, air, air, air)
        factors = zip(of_links, self.link_row.shapes, strict=True)
        links = Links(*(self._tensor(factor).expand(shape) for factor, shape in factors))
        return self.link_row.flatten(links)

    def _nominal(self) -> rates.Sent:
        scenario = self.scenario
        powers = scenario.ue_power, scenario.relay_power, scenario.jamming_power
        ue, relay, jamming = (self._tensor(power / scenario.noise_power) for power in powers)
        return rates.Sent(ue, (relay,) * scenario.num_helpers, (jamming,) * scenario.num_helpers)

    def _stand(self, nodes: Nodes) -> StandingNodes:
        scenario, ues = self.scenario, nodes.ue
        legitimate = nodes.legitimate.unsqueeze(-2)
        to_legitimate = channel.horizontal_distance(ues, legitimate)
        to_eavesdroppers = channel.horizontal_distance(
            ues.unsqueeze(-2), nodes.eavesdropper.unsqueeze(-3)
        )
        covered = offloading.covered(to_legitimate, scenario.coverage_radius)
        groups = ues, legitimate, nodes.eavesdropper
        leading = torch.broadcast_shapes(*(group.shape[:-2] for group in groups))
        positions = [group.expand(*leading, *group.shape[-2:]) for group in groups]
        return StandingNodes(
            torch.cat(positions, dim=-2).unsqueeze(-3),
            to_legitimate,
            channel.ground_to_air(scenario, to_legitimate, scenario.altitude),
            channel.ground_to_air(scenario, to_eavesdroppers, scenario.eavesdropper_altitude),
            covered,
            *(covered & energy.ue_can_pay(scenario, relay=relay) for relay in (False, True)),
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
        return tuple(distances.split_with_sizes(self._counts, dim=-1))

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
            self._between_helpers(nodes.helper),
        )
        return Geometry(distances, ue_to_helper, standing, gains)

    def _between_helpers(self, helper: Tensor) -> Tensor:
        """Path gains of the links between helpers (..., H, 2) m, at equal altitude."""
        if self.scenario.num_helpers == 1:
            return self._no_links
        first, second = zip(*channel.pairs(self.scenario.num_helpers), strict=True)
        distance = channel.horizontal_distance(helper[..., first, :], helper[..., second, :])
        return channel.air_to_air(self.scenario, distance, 0.0)

    def norm_limit(self, mode_rules: Sequence[str]) -> Tensor | None:
        """The bounds that :func:`hyuav.physics.motion.norm_limits` gives: (len(mode_rules), H)."""
        limits = motion.norm_limits(self.scenario, mode_rules)
        return None if limits is None else self._tensor(limits)

    def velocity(self, action: Tensor, norm_limit: Tensor | None) -> Tensor:
        """The velocity (..., 2) m/s of an action (..., 2) in units of v_max, within the limits.

        ``norm_limit`` is what :meth:`norm_limit` gives, broadcast against the actions.
        """
        return motion.feasible_velocity(action, self.scenario.max_speed, norm_limit)

    def control(self, action: Tensor, norm_limit: Tensor | None, mode_rule: ModeRule) -> Control:
        """What helpers do that are steered by actions.

        Args:
            action: (..., H, 2) in [-1, 1], the velocity in units of v_max; where powers are
                controlled (..., H, 3): the last number a is for the nominal power times
                10^(-(D / 10) (1 - a) / 2), with D = ``power_range`` in dB.
            norm_limit: as for :meth:`velocity`.
            mode_rule: which modes may be chosen.
        """
        scenario, power = self.scenario, None
        if scenario.power_control:
            below = (1.0 - action[..., 2].clamp(-1.0, 1.0)) * (scenario.power_range / 20.0)
            action, power = action[..., :2], torch.pow(10.0, -below)
        return Control(self.velocity(action, norm_limit), mode_rule, power)

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

    def outcomes(
        self,
        geometry: Geometry,
        gains: Links,
        tasks: Tasks | None,
        power: Tensor | None = None,
        vectors: Sequence[Sequence[bool]] | None = None,
    ) -> tuple[ModeOutcome, ...]:
        """The slot in each of the helpers' modes.

        Args:
            geometry: of the slot's nodes.
            gains: with fading.
            tasks: needed where :attr:`edge_can_saturate`, and used nowhere else.
            power: as in :class:`Control`.
            vectors: the modes that are asked for; all by default.

        Returns:
            one for each of them, in the order of :func:`hyuav.physics.modes.mode_vectors`.
        """
        sent = self._sent
        if power is not None:
            sent = sent.scaled(power.split(1, dim=-1))
        asked = modes.mode_vectors(self.scenario.num_helpers) if vectors is None else vectors
        return tuple(self._outcome(geometry, gains, sent, relays, tasks) for relays in asked)

    def _outcome(
        self,
        geometry: Geometry,
        gains: Links,
        sent: rates.Sent,
        relays: Sequence[bool],
        tasks: Tasks | None,
    ) -> ModeOutcome:
        """The slot in given modes of the helpers; each UE takes its own best way (eq. 5 and 11)."""
        scenario = self.scenario
        ways = self._ways(geometry, gains, sent, relays)
        way: Tensor | int
        way, rate, allowed = ways[0]
        for number, other_rate, other_allowed in ways[1:]:
            better = other_allowed & ((other_rate > rate) | ~allowed)
            way = torch.where(better, number, way)
            rate, allowed = torch.where(better, other_rate, rate), allowed | other_allowed
        decision = offloading.offloading_decision(rate, allowed, self._min_secrecy_rate)
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
        return ModeOutcome(rates.secrecy_sum_rate(rate, decision), rate, decision, way)

    def _ways(
        self, geometry: Geometry, gains: Links, sent: rates.Sent, relays: Sequence[bool]
    ) -> list[tuple[int, Tensor, Tensor]]:
        """How UEs may send to L: the way's number, the secrecy rates, and which UEs may take it."""
        kind = self.scenario.eavesdroppers
        jammers = [helper for helper, relaying in enumerate(relays) if not relaying]
        ways = []
        if jammers:
            straight = rates.straight_rates(gains, sent, jammers, kind)
            ways.append((0, rates.secrecy_rate(straight), geometry.standing.may_send))
        for helper, relaying in enumerate(relays):
            if relaying:
                through = rates.relay_rates(gains, sent, helper, jammers, kind)
                distance = geometry.ue_to_helper.select(-1, helper)
                near = offloading.covered(distance, self._coverage_radius)
                allowed = near & geometry.standing.may_be_relayed
                ways.append((helper + 1, rates.secrecy_rate(through), allowed))
        return ways


def slot(
    physics: Physics,
    nodes: Nodes,
    control: Control,
    fading: Links | None = None,
    tasks: Tasks | None = None,
) -> SlotOutcome:
    """One slot of any batch of flights: lines 6 to 11 of Algorithm 1.

    The helpers fly, then the channel is known: who offloads which way, and what it brings, in all
    modes (eq. 3 to 6, 8c to 8f and 11), and the modes that are chosen.

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
    outcomes = physics.outcomes(geometry, gains, tasks, control.power)
    return chosen(physics, nodes, control, moved.off_map, geometry.distances, outcomes)


def chosen(
    physics: Physics,
    nodes: Nodes,
    control: Control,
    off_map: Tensor,
    distances: Tensor,
    outcomes: tuple[ModeOutcome, ...],
) -> SlotOutcome:
    """Choose the modes by what each brings: line 9 of Algorithm 1.

    Args:
        physics: the scenario's constants.
        nodes: where all are in the slot.
        control: what the helpers do, with the mode rule.
        off_map: (..., H) bool, as in :class:`SlotOutcome`, like the next.
        distances: (..., H, U + 1 + E) m.
        outcomes: what :meth:`Physics.outcomes` gives for all modes.
    """
    taken = []
    best, relays = outcomes[0].sum_rate.unsqueeze(-1), physics.mode_vectors[0]
    for number, outcome in enumerate(outcomes[1:], start=1):
        better, best = modes.beats(outcome.sum_rate.unsqueeze(-1), best, control.mode_rule, number)
        relays = torch.where(better, physics.mode_vectors[number], relays)
        taken.append(better)
    return SlotOutcome(
        nodes,
        control,
        off_map,
        distances,
        outcomes,
        tuple(taken),
        best,
        relays,
        physics.scenario,
    )
