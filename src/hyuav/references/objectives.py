"""Expected rewards of one helper by an objective of one's own."""

from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav._support.errors import InputError, rejection
from hyuav.envs.reward import EPISODE, VELOCITY, Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.physics.channel import Links
from hyuav.physics.modes import ModeRule
from hyuav.physics.outcome import Control, SlotOutcome
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics, chosen
from hyuav.physics.tasks import Tasks
from hyuav.references.rewards import (
    CHUNK,
    episodes,
    geometry_of,
    is_random,
    mean_with_error,
    nodes_of,
    stratified_fading,
    tasks_of,
)

_SLOTS, _VELOCITIES = 2**10, 2**7
"""Computed at once where rewards depend on the velocity: their product fits the cache, and slots
are computed once for many velocities."""


def depends_on_velocity(reward: Reward, scenario: Scenario) -> bool:
    """Whether a slot earns what depends on how the helper flew."""
    return reward != DEFAULT and reward.dependence(scenario) == VELOCITY


def why_no_optimum(reward: Reward, scenario: Scenario) -> str | None:
    """One sentence on why there is no optimum of a reward; None where there is one.

    Args:
        reward: what a slot earns.
        scenario: in which a function is tried.
    """
    if reward == DEFAULT:
        return None
    if reward.is_transform:
        return "no optimum: a transform need not add up over slots"
    if reward.dependence(scenario) == EPISODE:
        return "no optimum: it does not add up over slots"
    if scenario.num_helpers > 1 or scenario.power_control:
        return "no optimum: of another reward it is known for one helper at its nominal power"
    return None


def reward_maps(
    physics: Physics,
    positions: Tensor,
    draws: int,
    generator: torch.Generator,
    reward: Reward,
    velocities: Tensor | None,
    mode_rules: Sequence[str],
) -> Tensor:
    """Expected reward of a slot at each position, under mode rules.

    Args:
        physics: in float64.
        positions: (P, 2) m, of the helper.
        draws: averaged over, the same at all positions and stratified.
        generator: of the draws.
        reward: what a slot earns.
        velocities: (D, 2) m/s, with which the helper may have come there, where that matters.
        mode_rules: R of them.

    Returns:
        (R, P), or (R, D, P) with velocities.

    Raises:
        InputError: the reward gives other than finite numbers somewhere.
    """
    draws = draws if is_random(physics) else 1
    fading = stratified_fading(physics, draws, generator)
    tasks = tasks_of(physics, (draws,), generator)
    # NaN where it does not matter, so that it is found out if it does.
    ways = positions.new_full((1, 2), torch.nan) if velocities is None else velocities
    maps = positions.new_empty(len(mode_rules), len(ways), len(positions))
    per_chunk = CHUNK // physics.scenario.num_ues if velocities is None else _SLOTS
    chunk = max(per_chunk // draws, 1)
    for part, found in zip(positions.split(chunk), maps.split(chunk, dim=-1), strict=True):
        shape = (len(part), draws)
        for own, rule in zip(found, mode_rules, strict=True):
            slot = _slots(physics, part[:, None, None], shape, fading, tasks, rule)
            for flown, out in zip(ways.split(_VELOCITIES), own.split(_VELOCITIES), strict=True):
                control = slot.control._replace(velocity=flown[:, None, None, None])
                earned = reward.of(slot._replace(control=control)).squeeze(-1)
                torch.mean(earned.expand(len(flown), *shape), dim=-1, out=out)
    if not maps.isfinite().all():
        kind = "all over the map" + ("" if velocities is not None else ", whatever the velocity")
        raise InputError(rejection("reward", reward.name, f"finite numbers {kind}"))
    return maps.squeeze(1) if velocities is None else maps


def estimate_objective(
    physics: Physics,
    path: Tensor,
    mode_rule: str,
    draws: int,
    generator: torch.Generator,
    reward: Reward,
) -> tuple[float, float]:
    """The mean return of a flight and its standard error, in the reward's unit.

    Args:
        physics: in float64.
        path: (T + 1, 1, 2) m; the first position is where the flight starts and earns nothing.
        mode_rule: who chooses the mode.
        draws: of whole episodes.
        generator: of the draws.
        reward: what a slot earns.
    """
    velocity = path.diff(dim=0) / physics.scenario.slot_duration
    returns = []
    for shape, fading, tasks in episodes(physics, len(path) - 1, draws, generator):
        outcome = _slots(physics, path[1:], shape, fading, tasks, mode_rule)
        outcome = outcome._replace(control=outcome.control._replace(velocity=velocity))
        returns.append(reward.of(outcome).squeeze(-1).expand(shape).sum(dim=-1))
    return mean_with_error(returns)


def _slots(
    physics: Physics,
    position: Tensor,
    shape: tuple[int, ...],
    fading: Links | None,
    tasks: Tasks | None,
    mode_rule: str,
) -> SlotOutcome:
    """What slots (*shape) bring, wherever the helper came from.

    Args:
        physics: in float64.
        position: broadcasts to (*shape, 1, 2) m.
        shape: of the slots.
        fading: (*shape, ...).
        tasks: (*shape, U).
        mode_rule: who chooses the mode.
    """
    nodes = nodes_of(physics, position, shape, fading)
    geometry, gains = geometry_of(physics, nodes, fading)
    rule = ModeRule.of([mode_rule], physics.scenario.num_helpers).each(torch.squeeze)
    control = Control(torch.full_like(nodes.helper, torch.nan), rule)
    on_map = torch.zeros_like(nodes.helper[..., 0], dtype=torch.bool)
    outcomes = physics.outcomes(geometry, gains, tasks)
    return chosen(physics, nodes, control, on_map, geometry.distances, outcomes)
