"""Expected rewards over fading and tasks, by Monte Carlo; exact where a slot is not random."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.physics.channel import Links
from hyuav.physics.offloading import MODE_RULES, ModeRule, chooses_relay, prefers_relay
from hyuav.physics.slot import Control, Physics, SlotOutcome
from hyuav.physics.tasks import Tasks, draw_tasks

_CHUNK = 2**19
"""Links computed at once: few enough for the cache, enough to outweigh PyTorch's overhead."""

_SLOTS, _VELOCITIES = 2**10, 2**7
"""Computed at once where rewards depend on the velocity: their product fits the cache, and slots
are computed once for many velocities."""

_STRATUM = 64
"""Draws whose mean represents a stratum of a link's fading."""


def reward_maps(
    physics: Physics,
    positions: Tensor,
    draws: int,
    generator: torch.Generator,
    reward: Reward = DEFAULT,
    velocities: Tensor | None = None,
    mode_rules: Sequence[str] = MODE_RULES,
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
    """
    if not _is_random(physics):
        draws = 1
    fading, tasks = (
        _stratified_fading(physics, draws, generator),
        _tasks(physics, (draws,), generator),
    )
    # NaN where it does not matter, so that it is found out if it does.
    ways = positions.new_full((1, 2), torch.nan) if velocities is None else velocities
    maps = torch.empty(len(mode_rules), len(ways), len(positions), dtype=positions.dtype)
    per_chunk = _CHUNK // physics.scenario.num_ues if velocities is None else _SLOTS
    chunk = max(per_chunk // draws, 1)
    for part, found in zip(positions.split(chunk), maps.split(chunk, dim=-1), strict=True):
        shape = (len(part), draws)
        slots = _slots(physics, part[:, None, None], shape, fading, tasks)
        for own, rule in zip(found, mode_rules, strict=True):
            for flown, out in zip(ways.split(_VELOCITIES), own.split(_VELOCITIES), strict=True):
                control = slots[rule].control._replace(velocity=flown[:, None, None, None])
                earned = reward.of(slots[rule]._replace(control=control)).squeeze(-1)
                torch.mean(earned.expand(len(flown), *shape), dim=-1, out=out)
    return maps.squeeze(1) if velocities is None else maps
    return maps


def estimate_return(
    physics: Physics,
    path: Tensor,
    mode_rule: str,
    draws: int,
    generator: torch.Generator,
    reward: Reward = DEFAULT,
) -> tuple[float, float, Tensor]:
    """The expected return of a flight.

    Args:
        physics: in float64.
        path: (T + 1, H, 2) m; the first position is where the flight starts and earns nothing.
        mode_rule: who chooses the mode.
        draws: of whole episodes.
        generator: of the draws.
        reward: what a slot earns.

    Returns:
        the mean return and its standard error in the reward's unit, and the modes (T, H) int64 (1
        relay, 0 jamming) that the mode rule takes by expected C_1 and C_0.
    """
    num_slots = len(path) - 1
    draws = draws if _is_random(physics) else 1
    chunk = max(_CHUNK // (num_slots * physics.scenario.num_ues), 1)
    velocity = path.diff(dim=0) / physics.scenario.slot_duration
    relay, jamming = torch.zeros(2, num_slots, dtype=path.dtype)
    returns = []
    for first in range(0, draws, chunk):
        shape = (min(chunk, draws - first), num_slots)
        row = physics.draw_fading(shape, generator)
        fading = None if row is None else physics.link_row.unflatten(row)
        tasks = _tasks(physics, shape, generator)
        outcome = _slots(physics, path[1:], shape, fading, tasks)[mode_rule]
        outcome = outcome._replace(control=outcome.control._replace(velocity=velocity))
        relay += outcome.relay.sum_rate.sum(dim=0)
        jamming += outcome.jamming.sum_rate.sum(dim=0)
        returns.append(reward.of(outcome).squeeze(-1).sum(dim=-1))
    episodes = torch.cat(returns)
    error = float(episodes.std()) / math.sqrt(draws) if draws > 1 else 0.0
    modes = {
        "hybrid": prefers_relay(relay, jamming).to(torch.int64),
        "relay": torch.ones(num_slots, dtype=torch.int64),
        "jamming": torch.zeros(num_slots, dtype=torch.int64),
    }
    return float(episodes.mean()), error, modes[mode_rule].unsqueeze(-1)


def _is_random(physics: Physics) -> bool:
    return physics.scenario.fading or physics.edge_can_saturate


def _tasks(physics: Physics, shape: tuple[int, ...], generator: torch.Generator) -> Tasks | None:
    if not physics.edge_can_saturate:
        return None
    return draw_tasks(physics.scenario, shape, generator, physics.dtype)


def _stratified_fading(physics: Physics, draws: int, generator: torch.Generator) -> Links | None:
    """A Latin hypercube of fading powers, (draws, ...); None where fading is off.

    A flight hovers for many slots, so errors of the maps add up over slots instead of averaging
    out. Each link's powers are the means of equally probable strata, shuffled independently:
    the parts of the reward that depend on one link alone are integrated almost without error
    (McKay, Beckman, Conover, Technometrics 21(2), 1979).
    """
    fading = physics.draw_fading((draws, _STRATUM), generator)
    if fading is None:
        return None
    links = fading.shape[-1]
    strata = fading.reshape(-1, links).sort(dim=0).values.reshape(draws, _STRATUM, links)
    shuffled = torch.rand((draws, links), generator=generator).argsort(dim=0)
    return physics.link_row.unflatten(strata.mean(dim=1).gather(0, shuffled))


def _slots(
    physics: Physics,
    position: Tensor,
    shape: tuple[int, ...],
    fading: Links | None,
    tasks: Tasks | None,
) -> dict[str, SlotOutcome]:
    """What slots (*shape) bring under each mode rule, wherever the helper came from.

    Args:
        physics: in float64.
        position: broadcasts to (*shape, H, 2) m.
        shape: of the slots.
        fading: (*shape, ...).
        tasks: (*shape, U).
    """
    if fading is None:  # Otherwise the fading brings its shape to all that follows.
        position = position.expand(*shape, *position.shape[-2:])
    nodes = physics.nodes._replace(helper=position)
    geometry = physics.geometry(nodes)
    gains = geometry.gains.faded(fading)
    # A UE at D_max is covered (eq. 5), also where float64 puts a grid point just beyond.
    closing = 1e-12 * physics.scenario.map_side
    geometry = geometry._replace(ue_to_helper=geometry.ue_to_helper - closing)
    relay = physics.relay_outcome(geometry, gains, tasks)
    jamming = physics.jamming_outcome(geometry, gains, tasks)
    on_map = torch.zeros(position.shape[:-1], dtype=torch.bool)
    outcomes = {}
    for name in MODE_RULES:
        rule = ModeRule(*(torch.as_tensor(flag)[0] for flag in ModeRule.of([name])))
        relays = chooses_relay(relay.sum_rate, jamming.sum_rate, rule)
        control = Control(torch.full_like(position, torch.nan), rule)
        distances = geometry.distances
        outcomes[name] = SlotOutcome(
            nodes, control, on_map, distances, relays, relay, jamming, physics.scenario
        )
    return outcomes
