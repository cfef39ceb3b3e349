"""Who offloads and in which mode the helper works: the paper's equations 5, 8d, 8f and 11."""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import torch
from torch import Tensor

from hyuav._support.parameters import OneOf
from hyuav.physics.energy import computation_energy


class ModeRule(NamedTuple):
    """Who chooses a helper's mode: flags, or one for each helper and flight, (..., H) bool."""

    may_relay: Tensor | bool
    """False where it always jams."""
    must_relay: Tensor | bool
    """True where it always relays."""

    @classmethod
    def of(cls, names: Sequence[str], device: torch.device | str | None = None) -> "ModeRule":
        """The rules of these names, of :data:`MODE_RULES`: flags (len(names), 1)."""
        flags = torch.tensor([_FLAGS[name] for name in names], device=device)
        return cls(*flags.split(1, dim=-1))


_FLAGS = {
    "hybrid": ModeRule(may_relay=True, must_relay=False),
    "relay": ModeRule(may_relay=True, must_relay=True),
    "jamming": ModeRule(may_relay=False, must_relay=False),
}

MODE_RULES = tuple(_FLAGS)
"""Who chooses the helpers' modes: the better of both in each slot, or always the same."""

ModeRuleName = Annotated[str, OneOf(*MODE_RULES)]


def covered_by_relay(
    ue_to_helper: Tensor, ue_to_legitimate: Tensor, coverage_radius: float
) -> Tensor:
    """Eq. 5 in relay mode: the UE lies within D_max of the helper and of the legitimate UAV.

    Args:
        ue_to_helper: D_{u,H}, (..., U) m.
        ue_to_legitimate: D_{u,L}, (U,) m.
        coverage_radius: D_max in m.

    Returns:
        (..., U) bool.
    """
    return (ue_to_helper <= coverage_radius) & (ue_to_legitimate <= coverage_radius)


def covered_by_legitimate(ue_to_legitimate: Tensor, coverage_radius: float) -> Tensor:
    """Eq. 5 in jamming mode: the UE lies within D_max of the legitimate UAV. (U,) bool."""
    return ue_to_legitimate <= coverage_radius


def offloading_decision(secrecy_rate: Tensor, allowed: Tensor, min_secrecy_rate: float) -> Tensor:
    """Eq. 11: offload where allowed and where the secrecy rate exceeds epsilon.

    Args:
        secrecy_rate: (..., U) bps/Hz.
        allowed: (..., U) bool, coverage (eq. 5) and the UE's energy budget (eq. 8e).
        min_secrecy_rate: epsilon in bps/Hz.

    Returns:
        z_u: (..., U) bool.
    """
    return allowed & (secrecy_rate > min_secrecy_rate)


def admitted_by_edge(
    offloading: Tensor,
    secrecy_rate: Tensor,
    cpu_cycles: Tensor,
    capacitance: float,
    slot_duration: float,
    edge_energy_budget: float,
) -> Tensor:
    """Eq. 8f: the edge server takes offloading UEs, best secrecy rate first, while energy lasts.

    The load accepted now is computed in the next slot. Admission ends with the first UE whose
    task would lift that slot's computing energy above E_L; ties keep the order of the UEs.

    Args:
        offloading: (..., U) bool, the decision of eq. 11.
        secrecy_rate: (..., U) bps/Hz.
        cpu_cycles: S_u F_u, (..., U) cycles.
        capacitance: kappa.
        slot_duration: Delta in s.
        edge_energy_budget: E_L in J.

    Returns:
        (..., U) bool, a subset of ``offloading``.
    """
    best_first = torch.where(offloading, secrecy_rate, -1.0).argsort(
        dim=-1, descending=True, stable=True
    )
    demand = (cpu_cycles * offloading).gather(-1, best_first).cumsum(dim=-1)
    energy = computation_energy(demand / slot_duration, capacitance, slot_duration)
    within = torch.zeros_like(offloading).scatter(-1, best_first, energy <= edge_energy_budget)
    return offloading & within


def prefers_relay(relay_sum_rate: Tensor, jamming_sum_rate: Tensor) -> Tensor:
    """The argmax of Algorithm 1: True (relay) only where C_1 > C_0, so that a tie jams."""
    return relay_sum_rate > jamming_sum_rate


def chooses_relay(relay_sum_rate: Tensor, jamming_sum_rate: Tensor, rule: ModeRule) -> Tensor:
    """The helpers' modes, True where they relay.

    Args:
        relay_sum_rate: C_1, (...) bps/Hz.
        jamming_sum_rate: C_0, (...) bps/Hz.
        rule: that decides.

    Returns:
        (..., H) bool.
    """
    better = prefers_relay(relay_sum_rate, jamming_sum_rate).unsqueeze(-1)
    return (better | rule.must_relay) & rule.may_relay
