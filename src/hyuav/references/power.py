"""The best level of a helper's power at each place."""

from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav.physics.scenario import Scenario
from hyuav.references.rewards import ExpectedReward, is_random

NEAR = 2.0
"""How far in dB from the level that a few draws find best the one of all draws is sought."""

ROUGH_DRAWS = 8
"""Few draws. Without any, relays would be set apart by up to 10 dB: what is secret to most of them
is so by their fading alone."""


def levels_of(scenario: Scenario, step: float) -> Tensor:
    """The levels that are tried, in units of the nominal power, from 1 down: (levels,) float64.

    Args:
        scenario: whether its power is controlled, and how far down.
        step: between two levels in dB.
    """
    if not scenario.power_control:
        return torch.ones(1, dtype=torch.float64, device="cpu")
    count = int(scenario.power_range / step * (1 + 1e-9)) + 1
    return 10.0 ** (torch.arange(count, dtype=torch.float64, device="cpu") * (-step / 10.0))


def best_levels(
    expected: ExpectedReward,
    rough: ExpectedReward,
    mode_rules: Sequence[str],
    places: Tensor,
    power: Tensor,
    helper: int,
    step: float,
) -> tuple[Tensor, Tensor]:
    """The expected rewards with the best level of one helper's power, and that level.

    All levels are tried by few draws of the fading, and by all those near the best of them.

    Args:
        expected: over fading and tasks.
        rough: the same of :data:`ROUGH_DRAWS`.
        mode_rules: who chooses the modes.
        places: (P, H, 2) m.
        power: (P, H) of all helpers, in units of the nominal power; that helper's is not used.
        helper: whose level is chosen, counted from 0.
        step: between two levels in dB.

    Returns:
        (len(mode_rules), P) bps/Hz, and (len(mode_rules), P) in units of the nominal power.
    """
    levels = levels_of(rough.physics.scenario, step).to(places)
    if len(levels) == 1:
        rewards = expected(mode_rules, places, None if bool((power == 1).all()) else power)
        return rewards, torch.ones_like(rewards)
    power = power.clone()
    best, index = places.new_empty(2, len(mode_rules), len(places))
    best.fill_(-torch.inf)
    for number, level in enumerate(levels):
        power[:, helper] = level
        _keep(best, index, rough(mode_rules, places, power), places.new_tensor(number))
    if expected is rough or not is_random(rough.physics):
        return best, levels[index.long()]
    near = max(round(NEAR / step), 1)
    first = index.clone()
    best.fill_(-torch.inf)
    for rule, mode_rule in enumerate(mode_rules):
        for offset in range(-near, near + 1):
            number = (first[rule] + offset).clamp(0, len(levels) - 1)
            power[:, helper] = levels[number.long()]
            found = expected([mode_rule], places, power)[0]
            _keep(best[rule], index[rule], found, number)
    return best, levels[index.long()]


def _keep(best: Tensor, index: Tensor, found: Tensor, number: Tensor) -> None:
    """Note what is larger than the best so far, and its number."""
    better = found > best
    best.copy_(torch.where(better, found, best))
    index.copy_(torch.where(better, number, index))
