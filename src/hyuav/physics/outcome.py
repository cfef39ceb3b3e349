"""What helpers do in a slot, and what it brings."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics import energy
from hyuav.physics.layout import Nodes
from hyuav.physics.modes import ModeRule
from hyuav.physics.scenario import Scenario


class Control(NamedTuple):
    """What the helpers do in a slot."""

    velocity: Tensor
    """(..., H, 2) m/s, within the limits that :meth:`Physics.velocity` keeps."""
    mode_rule: ModeRule = ModeRule()
    """Which modes they may choose; by default any, and the best is taken."""
    power: Tensor | None = None
    """(..., H), what they send at, in units of the nominal power of their mode; None for 1."""


class ModeOutcome(NamedTuple):
    """What a slot brings in one mode of each helper."""

    sum_rate: Tensor
    """C_k, the secrecy sum-rate: (...) bps/Hz."""
    secrecy_rate: Tensor
    """[R^d_u - R^e_u]^+, the way that a UE takes: (..., U) bps/Hz."""
    offloading: Tensor
    """z_u: (..., U) bool."""
    way: Tensor | int
    """(..., U), or of all: the way that a UE takes, 0 straight to L and i through helper i."""


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
    modes: tuple[ModeOutcome, ...]
    """What each of the modes brings, in the order of :func:`hyuav.physics.modes.mode_vectors`."""
    taken: tuple[Tensor, ...]
    """(..., 1) bool for each mode but the first: whether it was taken, given those before it. The
    last one that was taken is the chosen one."""
    sum_rate: Tensor
    """The secrecy sum-rate in the chosen modes: (..., 1) bps/Hz."""
    relays: Tensor
    """(..., H) bool, which helpers relay; the others jam."""
    scenario: Scenario
    """That is flown."""

    @property
    def relay(self) -> ModeOutcome:
        """What it brings if all helpers relay."""
        return self.modes[-1]

    @property
    def jamming(self) -> ModeOutcome:
        """What it brings if all helpers jam."""
        return self.modes[0]

    @property
    def offloading(self) -> Tensor:
        """z_u in the chosen modes: (..., U) bool."""
        return self._chosen([mode.offloading for mode in self.modes])

    @property
    def secrecy_rate(self) -> Tensor:
        """[R^d_u - R^e_u]^+ in the chosen modes: (..., U) bps/Hz."""
        return self._chosen([mode.secrecy_rate for mode in self.modes])

    @property
    def way(self) -> Tensor:
        """The way that each UE takes if it offloads, as in :class:`ModeOutcome`: (..., U) int64."""
        like = self.jamming.offloading
        ways = (torch.as_tensor(mode.way, device=like.device) for mode in self.modes)
        return self._chosen([way.expand_as(like) for way in ways])

    def _chosen(self, values: Sequence[Tensor]) -> Tensor:
        """Of values of each mode, those of the chosen one."""
        chosen, *others = values
        for taken, other in zip(self.taken, others, strict=True):
            chosen = torch.where(taken, other, chosen)
        return chosen

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
        scenario, way = self.scenario, self.way
        helpers = torch.arange(1, scenario.num_helpers + 1, device=way.device)
        through = ((way * self.offloading).unsqueeze(-1) == helpers).sum(dim=-2)
        share = scenario.slot_duration / scenario.num_ues
        relaying = energy.relay_energy(
            through.to(self.distances.dtype), scenario.relay_power, share
        )
        jamming = energy.jamming_energy(scenario.jamming_power, scenario.slot_duration)
        spent = torch.where(self.relays, relaying, torch.full_like(relaying, jamming))
        return spent if self.control.power is None else spent * self.control.power

    @property
    def ue_transmission_energy(self) -> Tensor:
        """What offloading takes the UEs that offload, 0 for the others: (..., U) J."""
        scenario = self.scenario
        of_way = scenario.ue_power, scenario.slot_duration, scenario.num_ues
        relayed, straight = (
            self.distances.new_full((), energy.offloading_energy(*of_way, relay=relay))
            for relay in (True, False)
        )
        return torch.where(self.way > 0, relayed, straight) * self.offloading
