"""A scenario bound to the equations: what one slot brings, for any batch of helper positions."""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import torch
from torch import Tensor

from hyuav._support.parameters import OneOf
from hyuav.physics import channel, energy, offloading
from hyuav.physics import motion as flight
from hyuav.physics import rates as secrecy
from hyuav.physics.scenario import Scenario

SCHEMES = ("hybrid", "relay", "jamming")
"""Who chooses the helper's mode: the better of both in each slot, or always the same."""

Scheme = Annotated[str, OneOf(*SCHEMES)]


class Tasks(NamedTuple):
    """The UEs' tasks of one slot."""

    size: Tensor
    """S_u: (..., U) bit."""
    cycles_per_bit: Tensor
    """F_u: (..., U) cycle/bit."""

    @property
    def cpu_cycles(self) -> Tensor:
        """S_u F_u: (..., U) cycles."""
        return self.size * self.cycles_per_bit


class ModeOutcome(NamedTuple):
    """What a slot brings in one mode of the helper."""

    sum_rate: Tensor
    """C_k, the secrecy sum-rate: (...) bps/Hz."""
    secrecy_rate: Tensor
    """[R^d_u - R^e_u]^+: (..., U) bps/Hz."""
    offloading: Tensor
    """z_u: (..., U) bool."""


class SecureOffloadingSystem:
    """The scenario's constants on a device, and the equations applied to them.

    Every method takes helper positions with any leading batch shape, written ``...``.

    Args:
        scenario: node positions and parameters.
        device: of all tensors.
        dtype: float32 or float64.
    """

    def __init__(
        self,
        scenario: Scenario,
        device: torch.device | str | None = None,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self.scenario = scenario
        self.device = torch.device(device) if device is not None else torch.device("cpu")
        self.dtype = dtype
        self.ue_positions = self._tensor(scenario.ue_positions)
        self.nodes = self._tensor(
            (
                *scenario.ue_positions,
                scenario.legitimate_position,
                scenario.eavesdropper_position,
            )
        )
        self.helper_start = self._tensor(scenario.helper_start)
        ue_to_legitimate, ue_to_eavesdropper = (
            channel.horizontal_distance(self.ue_positions, self._tensor(position))
            for position in (scenario.legitimate_position, scenario.eavesdropper_position)
        )
        self._ue_to_legitimate = ue_to_legitimate
        self._path_to_legitimate = channel.path_gain(
            ue_to_legitimate, scenario.altitude, scenario.ground_to_air_gain
        )
        self._path_to_eavesdropper = channel.path_gain(
            ue_to_eavesdropper, scenario.eavesdropper_altitude, scenario.ground_to_air_gain
        )
        ground = channel.k_factor_from_db(scenario.ground_to_air_k_factor)
        air = channel.k_factor_from_db(scenario.air_to_air_k_factor)
        self._k_factor = self._tensor([ground] * (3 * scenario.num_ues) + [air] * 2)
        self.fading_law = channel.RicianFading.of(self._k_factor)
        jamming_coverage = offloading.covered_by_legitimate(
            ue_to_legitimate, scenario.coverage_radius
        )
        self._allowed_to_jam = jamming_coverage & self._ue_can_pay(relay=False)
        self.edge_can_saturate = self._largest_load_exceeds_budget()
        """Whether the largest tasks of all UEs together would exceed the edge's budget E_L."""

    def _tensor(self, values: object) -> Tensor:
        return torch.tensor(values, dtype=self.dtype, device=self.device)

    def _ue_can_pay(self, *, relay: bool) -> bool:
        """Eq. 8e for a UE that offloads: the same for every UE, slot and position."""
        scenario = self.scenario
        spent = energy.offloading_energy(
            scenario.ue_power, scenario.slot_duration, scenario.num_ues, relay=relay
        )
        return spent <= scenario.ue_energy_budget

    def _largest_load_exceeds_budget(self) -> bool:
        scenario = self.scenario
        frequency = (
            scenario.num_ues * scenario.task_size[1] * scenario.cycles_per_bit[1]
        ) / scenario.slot_duration
        spent = energy.computation_energy(
            torch.tensor(frequency, dtype=torch.float64, device=self.device),
            scenario.capacitance,
            scenario.slot_duration,
        )
        return bool(spent > scenario.edge_energy_budget)

    def budget_speed(self, scheme: str) -> float:
        """The speed in m/s at which flying and transmitting spend E_H in one slot (eq. 8g).

        The mode is chosen after the move, so the dearer transmission open to ``scheme`` is
        set aside: jamming through the slot, or relaying for every UE.
        """
        scenario = self.scenario
        relaying = scenario.relay_power * scenario.slot_duration / 2
        jamming = energy.jamming_energy(scenario.jamming_power, scenario.slot_duration)
        transmission = {"relay": relaying, "jamming": jamming, "hybrid": max(relaying, jamming)}
        return energy.speed_within_budget(
            scenario.helper_energy_budget - transmission[scheme],
            scenario.helper_mass,
            scenario.slot_duration,
        )

    def norm_limit(self, schemes: Sequence[str]) -> Tensor | None:
        """The bound on the norm of the velocity, from the speed limit and the budget E_H.

        Args:
            schemes: one name of :data:`SCHEMES` for each row.

        Returns:
            (len(schemes), 1) m/s, or None where bounding each component by v_max suffices.
        """
        scenario = self.scenario
        disc = scenario.speed_limit == "disc"
        reachable = scenario.max_speed * (1.0 if disc else math.sqrt(2.0))
        limits = [min(self.budget_speed(scheme), reachable) for scheme in schemes]
        if not disc and all(limit == reachable for limit in limits):
            return None
        return self._tensor(limits).unsqueeze(-1)

    def move(self, position: Tensor, action: Tensor, norm_limit: Tensor | None) -> flight.Move:
        """Fly one slot from ``position`` (..., 2) m by ``action`` (..., 2) in units of v_max.

        ``norm_limit`` is what :meth:`norm_limit` gives, broadcast against the positions.
        """
        scenario = self.scenario
        velocity = flight.feasible_velocity(action, scenario.max_speed, norm_limit)
        return flight.move(position, velocity, scenario.slot_duration, scenario.map_side)

    def distances(self, position: Tensor) -> Tensor:
        """Horizontal distances from the helper to the UEs in order, L and E: (..., U + 2) m."""
        return channel.horizontal_distance(position.unsqueeze(-2), self.nodes)

    def draw_fading(self, shape: tuple[int, ...], generator: torch.Generator) -> Tensor | None:
        """One slot's fading powers: (*shape, 3 U + 2), or None where fading is off.

        In order: the U links to L, the U links to H, the U links to E, then H-L and H-E.
        """
        if not self.scenario.fading:
            return None
        return channel.rician_power(self._k_factor, (*shape, self._k_factor.shape[-1]), generator)

    def draw_tasks(self, shape: tuple[int, ...], generator: torch.Generator) -> Tasks:
        """One slot's tasks, uniform over the parameter ranges."""
        size, cycles_per_bit = torch.rand(
            (2, *shape, self.scenario.num_ues),
            generator=generator,
            dtype=self.dtype,
            device=self.device,
        )
        return self.tasks_of(size, cycles_per_bit)

    def tasks_of(self, size: Tensor, cycles_per_bit: Tensor) -> Tasks:
        """The tasks at levels (..., U) of their ranges: 0 the smallest, 1 the largest."""
        ranges = (self.scenario.task_size, self.scenario.cycles_per_bit)
        return Tasks(
            *(
                low + (high - low) * level
                for (low, high), level in zip(ranges, (size, cycles_per_bit), strict=True)
            )
        )

    def mean_tasks(self, shape: tuple[int, ...]) -> Tasks:
        """Tasks of mean size and mean cycles per bit, for pictures that draw none."""
        ranges = (self.scenario.task_size, self.scenario.cycles_per_bit)
        full = (*shape, self.scenario.num_ues)
        return Tasks(*(self._tensor(sum(bounds) / 2).expand(full) for bounds in ranges))

    def channel_gains(self, distances: Tensor, fading: Tensor | None) -> secrecy.ChannelGains:
        """Eq. 3 and 4 for every link.

        Args:
            distances: (..., U + 2) m from :meth:`distances`.
            fading: (..., 3 U + 2) from :meth:`draw_fading`.
        """
        scenario = self.scenario
        num_ues = scenario.num_ues
        to_ues, to_legitimate, to_eavesdropper = distances.split((num_ues, 1, 1), dim=-1)
        climb = scenario.altitude - scenario.eavesdropper_altitude
        gains = secrecy.ChannelGains(
            self._path_to_legitimate,
            channel.path_gain(to_ues, scenario.altitude, scenario.ground_to_air_gain),
            self._path_to_eavesdropper,
            channel.path_gain(to_legitimate, 0.0, scenario.air_to_air_gain),
            channel.path_gain(to_eavesdropper, climb, scenario.air_to_air_gain),
        )
        if fading is None:
            return gains
        powers = fading.split((num_ues, num_ues, num_ues, 1, 1), dim=-1)
        return secrecy.ChannelGains(
            *(gain * power for gain, power in zip(gains, powers, strict=True))
        )

    def relay_outcome(
        self, distances: Tensor, gains: secrecy.ChannelGains, tasks: Tasks | None
    ) -> ModeOutcome:
        """The slot in relay mode; ``tasks`` is needed where :attr:`edge_can_saturate`."""
        scenario = self.scenario
        rates = secrecy.relay_rates(
            gains, scenario.ue_power, scenario.relay_power, scenario.noise_power
        )
        covered = offloading.covered_by_relay(
            distances[..., : scenario.num_ues], self._ue_to_legitimate, scenario.coverage_radius
        )
        return self._outcome(rates, covered & self._ue_can_pay(relay=True), tasks)

    def jamming_outcome(self, gains: secrecy.ChannelGains, tasks: Tasks | None) -> ModeOutcome:
        """The slot in jamming mode; ``tasks`` is needed where :attr:`edge_can_saturate`."""
        scenario = self.scenario
        rates = secrecy.jamming_rates(
            gains, scenario.ue_power, scenario.jamming_power, scenario.noise_power
        )
        return self._outcome(rates, self._allowed_to_jam, tasks)

    def _outcome(
        self, rates: secrecy.AchievableRates, allowed: Tensor, tasks: Tasks | None
    ) -> ModeOutcome:
        scenario = self.scenario
        rate = secrecy.secrecy_rate(rates)
        decision = offloading.offloading_decision(rate, allowed, scenario.min_secrecy_rate)
        if tasks is not None:
            decision = offloading.admitted_by_edge(
                decision,
                rate,
                tasks.cpu_cycles,
                scenario.capacitance,
                scenario.slot_duration,
                scenario.edge_energy_budget,
            )
        return ModeOutcome(secrecy.secrecy_sum_rate(rate, decision), rate, decision)

    def sum_rates(
        self, position: Tensor, fading: Tensor | None = None, tasks: Tasks | None = None
    ) -> tuple[Tensor, Tensor]:
        """C_1 (relay) and C_0 (jamming) at helper positions.

        Args:
            position: (..., 2) m.
            fading: (..., 3 U + 2) broadcast against the positions; None for no fading.
            tasks: of shape (..., U); None where the edge server is never full.

        Returns:
            two tensors (...) in bps/Hz.

        Raises:
            ValueError: no tasks are given though they can fill the edge server.
        """
        if tasks is None and self.edge_can_saturate:
            raise ValueError("tasks: expected, because they can fill the edge server")
        distances = self.distances(position)
        gains = self.channel_gains(distances, fading)
        relay = self.relay_outcome(distances, gains, tasks)
        jamming = self.jamming_outcome(gains, tasks)
        return torch.broadcast_tensors(relay.sum_rate, jamming.sum_rate)
