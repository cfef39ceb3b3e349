"""What only an evaluation needs to know of a slot: who offloads, rates, energies, budgets."""

from typing import NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Composite, Unbounded

from hyuav.physics import energy
from hyuav.physics.motion import Move
from hyuav.physics.slot import ModeOutcome, SecureOffloadingSystem, Tasks


def diagnostics_spec(batch_size: torch.Size, num_ues: int, device: torch.device) -> Composite:
    """The spec of the ``diagnostics`` entry that :func:`diagnose` computes; zero after a reset.

    - ``offloading`` (U,) bool: z_u, the UEs that offload.
    - ``secrecy_rate`` (U,) bps/Hz: of the UEs that offload, 0 for the others.
    - ``relay_sum_rate``, ``jamming_sum_rate`` (1,) bps/Hz: C_1 and C_0, whatever the mode.
    - ``ue_energy`` (U,) J: of transmitting, or of local execution where a UE does not offload.
    - ``edge_load`` (1,) cycle: taken in this slot, computed in the next.
    - ``edge_energy`` (1,) J: of computing what was taken in the previous slot.
    - ``helper_energy`` (1,) J: of flying and transmitting.
    - ``budget_violation`` (1,) int64: how many nodes spend more than E_u, E_L or E_H.
    """
    per_ue, per_slot = (*batch_size, num_ues), (*batch_size, 1)
    scalars = ("relay_sum_rate", "jamming_sum_rate", "edge_load", "edge_energy", "helper_energy")

    def numbers(shape: tuple[int, ...], dtype: torch.dtype = torch.float32) -> Unbounded:
        return Unbounded(shape, dtype=dtype, device=device)

    return Composite(
        offloading=Binary(num_ues, per_ue, dtype=torch.bool, device=device),
        secrecy_rate=numbers(per_ue),
        ue_energy=numbers(per_ue),
        budget_violation=numbers(per_slot, torch.int64),
        **{name: numbers(per_slot) for name in scalars},
        shape=batch_size,
        device=device,
    )


class Slot(NamedTuple):
    """One slot at the helper's position, in both modes and in the chosen one."""

    position: Tensor
    """(..., 2) m."""
    distances: Tensor
    """(..., U + 2) m."""
    relay_mode: Tensor
    """(..., 1) bool, whether the helper relays."""
    relay: ModeOutcome
    jamming: ModeOutcome
    tasks: Tasks | None
    """None where neither the edge's admission nor diagnostics need them."""
    fading: Tensor | None
    """(..., 3 U + 2) powers, or None where fading is off."""


def diagnose(
    system: SecureOffloadingSystem, flown: Move, slot: Slot, edge_load: Tensor
) -> TensorDictBase:
    """Account for one slot; the entries are those of :func:`diagnostics_spec`.

    Args:
        system: the scenario's equations.
        flown: the slot's flight.
        slot: what the slot brought, with its tasks.
        edge_load: (..., 1) cycles that the edge server took in the previous slot.
    """
    assert slot.tasks is not None
    relay_mode, relay, jamming = slot.relay_mode, slot.relay, slot.jamming
    cpu_cycles = slot.tasks.cpu_cycles
    scenario = system.scenario
    duration, num_ues = scenario.slot_duration, scenario.num_ues
    offloading = torch.where(relay_mode, relay.offloading, jamming.offloading)
    secrecy_rate = torch.where(relay_mode, relay.secrecy_rate, jamming.secrecy_rate)
    sending = torch.where(
        relay_mode,
        energy.offloading_energy(scenario.ue_power, duration, num_ues, relay=True),
        energy.offloading_energy(scenario.ue_power, duration, num_ues, relay=False),
    )
    local = energy.computation_energy(cpu_cycles / duration, scenario.capacitance, duration)
    ue_energy = torch.where(offloading, sending, local)
    edge_energy = energy.computation_energy(edge_load / duration, scenario.capacitance, duration)
    transmitting = torch.where(
        relay_mode,
        energy.relay_energy(offloading, scenario.relay_power, duration).unsqueeze(-1),
        energy.jamming_energy(scenario.jamming_power, duration),
    )
    flying = energy.flight_energy(flown.velocity, scenario.helper_mass, duration).unsqueeze(-1)
    helper_energy = flying + transmitting
    violations = (
        (ue_energy > _rounded_up(scenario.ue_energy_budget)).sum(dim=-1, keepdim=True)
        + (edge_energy > _rounded_up(scenario.edge_energy_budget))
        + (helper_energy > _rounded_up(scenario.helper_energy_budget))
    )
    return TensorDict(
        offloading=offloading,
        secrecy_rate=secrecy_rate * offloading,
        relay_sum_rate=relay.sum_rate.unsqueeze(-1),
        jamming_sum_rate=jamming.sum_rate.unsqueeze(-1),
        ue_energy=ue_energy,
        edge_load=(cpu_cycles * offloading).sum(dim=-1, keepdim=True),
        edge_energy=edge_energy,
        helper_energy=helper_energy,
        budget_violation=violations,
        batch_size=relay_mode.shape[:-1],
        device=system.device,
    )


def _rounded_up(budget: float) -> float:
    """A budget with room for float32 rounding where it is met exactly."""
    return budget * (1.0 + 1e-5)
