"""What only an evaluation needs to know of a slot: who offloads, rates, energies, budgets."""

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Composite, Unbounded

from hyuav.physics import energy
from hyuav.physics.outcome import SlotOutcome
from hyuav.physics.scenario import Scenario
from hyuav.physics.tasks import Tasks


def diagnostics_spec(batch_size: torch.Size, scenario: Scenario, device: torch.device) -> Composite:
    """The spec of the ``diagnostics`` entry that :func:`diagnose` computes; zero after a reset.

    - ``offloading`` (U,) bool: z_u, the UEs that offload.
    - ``secrecy_rate`` (U,) bps/Hz: of the UEs that offload, 0 for the others.
    - ``relay_sum_rate``, ``jamming_sum_rate`` (1,) bps/Hz: what all helpers relaying and all
      jamming would bring, C_1 and C_0, whatever the modes.
    - ``ue_energy`` (U,) J: of transmitting, or of local execution where a UE does not offload.
    - ``edge_load`` (1,) cycle: taken in this slot, computed in the next.
    - ``edge_energy`` (1,) J: of computing what was taken in the previous slot.
    - ``helper_energy`` (H,) J: of flying and transmitting.
    - ``budget_violation`` (1,) int64: how many nodes spend more than E_u, E_L or E_H.
    - ``way`` (U,) int64, with several helpers only: how a UE sends if it offloads, 0 straight to L
      and i through helper i. Of one helper the mode tells it.
    """
    num_ues = scenario.num_ues
    per_ue, per_slot = (*batch_size, num_ues), (*batch_size, 1)
    scalars = ("relay_sum_rate", "jamming_sum_rate", "edge_load", "edge_energy")

    def numbers(shape: tuple[int, ...], dtype: torch.dtype = torch.float32) -> Unbounded:
        return Unbounded(shape, dtype=dtype, device=device)

    several = {"way": numbers(per_ue, torch.int64)} if scenario.num_helpers > 1 else {}
    return Composite(
        offloading=Binary(num_ues, per_ue, dtype=torch.bool, device=device),
        secrecy_rate=numbers(per_ue),
        ue_energy=numbers(per_ue),
        helper_energy=numbers((*batch_size, scenario.num_helpers)),
        budget_violation=numbers(per_slot, torch.int64),
        **{name: numbers(per_slot) for name in scalars},
        **several,
        shape=batch_size,
        device=device,
    )


def diagnose(
    scenario: Scenario, slot: SlotOutcome, tasks: Tasks, edge_load: Tensor
) -> TensorDictBase:
    """Account for one slot; the entries are those of :func:`diagnostics_spec`.

    Args:
        scenario: that is flown.
        slot: what the slot brought.
        tasks: of the slot.
        edge_load: (..., 1) cycles that the edge server took in the previous slot.
    """
    cpu_cycles, offloading = tasks.cpu_cycles, slot.offloading
    duration = scenario.slot_duration
    local = energy.computation_energy(cpu_cycles / duration, scenario.capacitance, duration)
    ue_energy = torch.where(offloading, slot.ue_transmission_energy, local)
    edge_energy = energy.computation_energy(edge_load / duration, scenario.capacitance, duration)
    helper_energy = slot.flight_energy + slot.helper_transmission_energy
    violations = (
        (ue_energy > _rounded_up(scenario.ue_energy_budget)).sum(dim=-1, keepdim=True)
        + (edge_energy > _rounded_up(scenario.edge_energy_budget))
        + (helper_energy > _rounded_up(scenario.helper_energy_budget)).sum(dim=-1, keepdim=True)
    )
    several = {"way": slot.way} if scenario.num_helpers > 1 else {}
    return TensorDict(
        offloading=offloading,
        secrecy_rate=slot.offloading_rate,
        relay_sum_rate=slot.relay.sum_rate.unsqueeze(-1),
        jamming_sum_rate=slot.jamming.sum_rate.unsqueeze(-1),
        ue_energy=ue_energy,
        edge_load=(cpu_cycles * offloading).sum(dim=-1, keepdim=True),
        edge_energy=edge_energy,
        helper_energy=helper_energy,
        budget_violation=violations,
        **several,
        batch_size=slot.relays.shape[:-1],
        device=edge_load.device,
    )


def _rounded_up(budget: float) -> float:
    """A budget with room for float32 rounding where it is met exactly."""
    return budget * (1.0 + 1e-5)
