"""Who offloads: the paper's equations 5, 8d, 8f and 11."""

import torch
from torch import Tensor

from hyuav.physics.energy import computation_energy


def covered(distance: Tensor, coverage_radius: float | Tensor) -> Tensor:
    """Eq. 5: whether a UE lies within D_max of a UAV.

    It may send straight to the legitimate UAV if that covers it, and through a helper if both do.

    Args:
        distance: horizontal, (...) m.
        coverage_radius: D_max in m.

    Returns:
        (...) bool.
    """
    return distance <= coverage_radius


def offloading_decision(
    secrecy_rate: Tensor, allowed: Tensor, min_secrecy_rate: float | Tensor
) -> Tensor:
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
