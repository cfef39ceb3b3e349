"""Where several helpers had best fly, roughly: each in turn, with the others held."""

import torch
from torch import Tensor

from hyuav.physics.slot import Physics
from hyuav.references.power import best_levels
from hyuav.references.rewards import ExpectedReward
from hyuav.references.straight import jamming_destinations, relay_destination

COUNT = 26
"""Places along each side of the map that are tried."""

POWER_STEP = 10.0
"""Between the levels of power that are tried, in dB."""

ROUNDS = 2
"""How often each helper chooses anew."""


def destinations(physics: Physics, rough: ExpectedReward, mode_rule: str) -> tuple[Tensor, Tensor]:
    """Where helpers earn most that fly there straight and stay, found from several beginnings.

    Args:
        physics: of the scenario.
        rough: what slots bring, by few draws of the fading.
        mode_rule: who chooses the modes.

    Returns:
        (H, 2) m, and their powers (H,) in units of the nominal one; of one helper, its start.
    """
    scenario, starts = physics.scenario, physics.nodes.helper
    nominal = starts.new_ones(len(starts))
    if len(starts) == 1:
        return starts, nominal
    half = scenario.map_side / 2
    axis = torch.linspace(-half, half, COUNT, dtype=starts.dtype, device="cpu")
    tried = torch.cartesian_prod(axis, axis)
    slots = _slots_to(physics, tried.unsqueeze(1))
    jamming = starts.new_tensor(jamming_destinations(scenario))
    relay = starts.new_tensor(relay_destination(scenario)).expand_as(starts)
    best = -1.0
    for beginning in (jamming, relay, starts):
        places, power, worth = beginning.clone(), nominal.clone(), -1.0
        for turn in range(ROUNDS * len(starts)):
            helper = turn % len(starts)
            own, shares = places.expand(len(tried), -1, -1).clone(), power.expand(len(tried), -1)
            own[:, helper] = tried
            rewards, levels = best_levels(
                rough, rough, [mode_rule], own, shares, helper, POWER_STEP
            )
            arrival = _slots_to(physics, places.unsqueeze(0)).expand(len(tried), -1).clone()
            arrival[:, helper] = slots[:, helper]
            left = (scenario.num_slots + 1 - arrival.amax(dim=-1)).clamp(min=1e-3)
            worths = rewards[0] * left
            index = int(worths.argmax())
            if float(worths[index]) > worth + 1e-6:
                worth = float(worths[index])
                places[helper], power[helper] = tried[index], levels[0, index]
        if worth > best:
            best, found = worth, (places, power)
    return found


def _slots_to(physics: Physics, places: Tensor) -> Tensor:
    """How many slots each helper flies to places (P, H or 1, 2) m: (P, H)."""
    step = physics.scenario.max_speed * physics.scenario.slot_duration
    return ((places - physics.nodes.helper).abs().amax(dim=-1) / step).ceil()
