"""The helper's motion: speed limits, the map (eq. 8c) and the flight budget (eq. 8g)."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics.energy import budget_speeds
from hyuav.physics.scenario import Scenario


class Move(NamedTuple):
    """One slot of flight."""

    position: Tensor
    """(..., 2) m, where the helper is in this slot."""
    velocity: Tensor
    """(..., 2) m/s, as flown after the limits; kept where the map's edge turned the helper back."""
    off_map: Tensor
    """(...) bool, the flight would have left the map and ended where it began."""


def norm_limits(scenario: Scenario, mode_rules: Sequence[str]) -> list[list[float]] | None:
    """The bounds on the norm of the velocity in m/s, from the speed limit and the budget E_H.

    Args:
        scenario: that is flown.
        mode_rules: as :func:`hyuav.physics.modes.fixed_modes` reads them.

    Returns:
        for each mode rule one for each helper, or None where bounding each component by v_max
        suffices.
    """
    disc = scenario.speed_limit == "disc"
    reachable = scenario.max_speed * (1.0 if disc else math.sqrt(2.0))
    limits = [
        [min(speed, reachable) for speed in budget_speeds(scenario, rule)] for rule in mode_rules
    ]
    if not disc and all(limit == reachable for own in limits for limit in own):
        return None
    return limits


def feasible_velocity(action: Tensor, max_speed: float, norm_limit: Tensor | None) -> Tensor:
    """Turn an action into a velocity within the speed limit and the helper's energy budget.

    Args:
        action: (..., 2) velocity in units of v_max; clipped to [-1, 1].
        max_speed: v_max in m/s, the bound of each component.
        norm_limit: (..., 1) bound of the norm in m/s (a disc-shaped speed limit, or the speed
            at which the budget E_H is spent, eq. 8g); None where the components' bound suffices.
            Faster velocities are shortened, keeping their direction.

    Returns:
        (..., 2) m/s.
    """
    velocity = action.clamp(-1.0, 1.0) * max_speed
    if norm_limit is None:
        return velocity
    norm = torch.linalg.vector_norm(velocity, dim=-1, keepdim=True)
    return torch.where(norm > norm_limit, velocity * (norm_limit / norm), velocity)


def move(position: Tensor, velocity: Tensor, slot_duration: float, map_side: float) -> Move:
    """Fly for one slot, or stay where the flight would leave the map (eq. 8c).

    Args:
        position: (..., 2) m.
        velocity: (..., 2) m/s.
        slot_duration: Delta in s.
        map_side: l_max in m.
    """
    target = position + velocity * slot_duration
    off_map = ~(target.abs() <= map_side / 2).all(dim=-1)  # so that NaN does not move the helper
    position = torch.where(off_map.unsqueeze(-1), position, target)
    return Move(position, velocity, off_map)
