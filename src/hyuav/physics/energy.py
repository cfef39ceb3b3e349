"""Energies of computing, transmitting and flying: the paper's equation 7 and section II-C."""

import torch
from torch import Tensor

from hyuav.physics.modes import fixed_modes
from hyuav.physics.scenario import Scenario


def computation_energy(frequency: Tensor, capacitance: float, slot_duration: float) -> Tensor:
    """Eq. 7: kappa f^3 Delta in J, for a CPU that runs at ``frequency`` (cycle/s) through a slot.

    The capacitance is drawn into the cube so that float32 does not overflow with many UEs.
    """
    return (capacitance ** (1.0 / 3.0) * frequency).pow(3) * slot_duration


def offloading_energy(ue_power: float, slot_duration: float, num_ues: int, *, relay: bool) -> float:
    """First term of eq. 8e: p_u Delta / U in J, half of it in relay mode (two time fractions)."""
    return ue_power * slot_duration / ((2 if relay else 1) * num_ues)


def relay_energy(relayed_ues: Tensor, relay_power: Tensor | float, share: float) -> Tensor:
    """Transmission energy of relays, p_i Delta / (2 U) in J for each UE that sends through one.

    Args:
        relayed_ues: (..., H), how many UEs send through each.
        relay_power: p_i in W, (..., H) or of all.
        share: Delta / U in s, the UE's share of the slot.

    Returns:
        (..., H) J.
    """
    return relayed_ues * (relay_power * share / 2)


def jamming_energy(jamming_power: float, slot_duration: float) -> float:
    """Transmission energy in jamming mode, p_J Delta in J: the helper jams through the slot."""
    return jamming_power * slot_duration


def ue_can_pay(scenario: Scenario, *, relay: bool) -> bool:
    """Eq. 8e for a UE that offloads: the same for every UE, slot and position."""
    spent = offloading_energy(
        scenario.ue_power, scenario.slot_duration, scenario.num_ues, relay=relay
    )
    return spent <= scenario.ue_energy_budget


def edge_energy(scenario: Scenario, cycles: float) -> float:
    """Eq. 7 for the edge server: what computing so many cycles in one slot takes, in J."""
    frequency = torch.tensor(cycles / scenario.slot_duration, dtype=torch.float64, device="cpu")
    return float(computation_energy(frequency, scenario.capacitance, scenario.slot_duration))


def edge_can_saturate(scenario: Scenario) -> bool:
    """Whether the largest tasks of all UEs together would exceed the edge's budget E_L."""
    cycles = scenario.num_ues * scenario.task_size[1] * scenario.cycles_per_bit[1]
    return edge_energy(scenario, cycles) > scenario.edge_energy_budget


def flight_energy(velocity: Tensor, helper_mass: float, slot_duration: float) -> Tensor:
    """0.5 M Delta |v|^2 in J.

    Args:
        velocity: (..., 2) m/s.
        helper_mass: M in kg.
        slot_duration: Delta in s.

    Returns:
        (...) J.
    """
    return 0.5 * helper_mass * slot_duration * velocity.square().sum(dim=-1)


def speed_within_budget(energy: float, helper_mass: float, slot_duration: float) -> float:
    """The speed in m/s at which flying through a slot takes ``energy`` J; 0 below 0 J."""
    return float((max(energy, 0.0) / (0.5 * helper_mass * slot_duration)) ** 0.5)


def budget_speeds(scenario: Scenario, mode_rule: str) -> list[float]:
    """The speeds in m/s at which flying and transmitting spend E_H in one slot (eq. 8g).

    The mode is chosen after the move, so the dearer transmission open to the mode rule, as
    :func:`hyuav.physics.modes.fixed_modes` reads it, is set aside: jamming through the slot,
    or relaying for every UE.

    Returns:
        one for each helper.
    """
    relaying = scenario.relay_power * scenario.slot_duration / 2
    jamming = jamming_energy(scenario.jamming_power, scenario.slot_duration)
    modes = fixed_modes(mode_rule, scenario.num_helpers)
    transmissions = (
        [max(relaying, jamming)] * scenario.num_helpers
        if modes is None
        else [relaying if relays else jamming for relays in modes]
    )
    return [
        speed_within_budget(
            scenario.helper_energy_budget - transmission,
            scenario.helper_mass,
            scenario.slot_duration,
        )
        for transmission in transmissions
    ]
