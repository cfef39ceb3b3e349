"""Expected rewards over fading and tasks, by Monte Carlo; exact where a slot is not random."""

import math

import torch
from torch import Tensor

from hyuav.physics.channel import Links
from hyuav.physics.offloading import MODE_RULES, prefers_relay
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import Tasks, draw_tasks

_CHUNK = 2**19
"""Links computed at once: few enough for the cache, enough to outweigh PyTorch's overhead."""

_STRATUM = 64
"""Draws whose mean represents a stratum of a link's fading."""


def reward_maps(
    physics: Physics, positions: Tensor, draws: int, generator: torch.Generator
) -> Tensor:
    """Expected reward of a slot at each position, under every mode rule.

    Args:
        physics: in float64.
        positions: (P, 2) m, of the helper.
        draws: averaged over, the same at all positions and stratified.
        generator: of the draws.

    Returns:
        (3, P) bps/Hz, in the order of :data:`hyuav.physics.offloading.MODE_RULES`.
    """
    if not _is_random(physics):
        draws = 1
    fading, tasks = (
        _stratified_fading(physics, draws, generator),
        _tasks(physics, (draws,), generator),
    )
    maps = torch.empty(
        len(MODE_RULES), len(positions), dtype=positions.dtype, device=positions.device
    )
    chunk = max(_CHUNK // (draws * physics.scenario.num_ues), 1)
    for part, out in zip(positions.split(chunk), maps.split(chunk, dim=1), strict=True):
        rewards = _rewards(physics, part[:, None, None], (len(part), draws), fading, tasks)
        torch.mean(rewards, dim=-1, out=out)
    return maps


def estimate_return(
    physics: Physics,
    path: Tensor,
    mode_rule: str,
    draws: int,
    generator: torch.Generator,
) -> tuple[float, float, Tensor]:
    """The expected return of a flight.

    Args:
        physics: in float64.
        path: (T + 1, H, 2) m; the first position is where the flight starts and earns nothing.
        mode_rule: who chooses the mode.
        draws: of whole episodes.
        generator: of the draws.

    Returns:
        the mean return and its standard error in bps/Hz, and the modes (T, H) int64 (1
        relay, 0 jamming) that the mode rule takes by expected C_1 and C_0.
    """
    num_slots = len(path) - 1
    draws = draws if _is_random(physics) else 1
    chunk = max(_CHUNK // (num_slots * physics.scenario.num_ues), 1)
    total = torch.zeros(len(MODE_RULES), num_slots, dtype=path.dtype, device=path.device)
    returns = []
    for first in range(0, draws, chunk):
        shape = (min(chunk, draws - first), num_slots)
        row = physics.draw_fading(shape, generator)
        fading = None if row is None else physics.link_row.unflatten(row)
        tasks = _tasks(physics, shape, generator)
        rewards = _rewards(physics, path[1:], shape, fading, tasks)
        total += rewards.sum(dim=1)
        returns.append(rewards[MODE_RULES.index(mode_rule)].sum(dim=-1))
    episodes = torch.cat(returns)
    error = float(episodes.std()) / math.sqrt(draws) if draws > 1 else 0.0
    relay, jamming = total[MODE_RULES.index("relay")], total[MODE_RULES.index("jamming")]
    modes = {
        "hybrid": prefers_relay(relay, jamming).to(torch.int64),
        "relay": torch.ones(num_slots, dtype=torch.int64, device=path.device),
        "jamming": torch.zeros(num_slots, dtype=torch.int64, device=path.device),
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
    shuffled = torch.rand(
        (draws, links), generator=generator, dtype=torch.float32, device=generator.device
    ).argsort(dim=0)
    return physics.link_row.unflatten(strata.mean(dim=1).gather(0, shuffled))


def _rewards(
    physics: Physics,
    position: Tensor,
    shape: tuple[int, ...],
    fading: Links | None,
    tasks: Tasks | None,
) -> Tensor:
    """Rewards with helpers that broadcast to (*shape, H, 2) m: (3, *shape) bps/Hz."""
    if fading is None:  # Otherwise the fading brings its shape to all that follows.
        position = position.expand(*shape, *position.shape[-2:])
    geometry = physics.geometry(physics.nodes._replace(helper=position))
    gains = geometry.gains.faded(fading)
    # A UE at D_max is covered (eq. 5), also where float64 puts a grid point just beyond.
    closing = 1e-12 * physics.scenario.map_side
    geometry = geometry._replace(ue_to_helper=geometry.ue_to_helper - closing)
    relay = physics.relay_outcome(geometry, gains, tasks).sum_rate
    jamming = physics.jamming_outcome(geometry, gains, tasks).sum_rate
    rewards = {"hybrid": torch.maximum(relay, jamming), "relay": relay, "jamming": jamming}
    return torch.stack([rewards[rule] for rule in MODE_RULES])
