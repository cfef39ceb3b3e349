"""Expected rewards over fading and tasks, by Monte Carlo; exact where a slot is not random."""

import math

import torch
from torch import Tensor

from hyuav.physics.offloading import prefers_relay
from hyuav.physics.slot import SCHEMES, SecureOffloadingSystem, Tasks

_CHUNK = 2**19
"""Links computed at once: few enough for the cache, enough to outweigh PyTorch's overhead."""

_STRATUM = 64
"""Draws whose mean represents a stratum of a link's fading."""


def reward_maps(
    system: SecureOffloadingSystem, positions: Tensor, draws: int, generator: torch.Generator
) -> Tensor:
    """Expected reward of a slot at each position, in every scheme.

    Args:
        system: in float64.
        positions: (P, 2) m.
        draws: averaged over, the same at all positions and stratified.
        generator: of the draws.

    Returns:
        (3, P) bps/Hz, in the order of :data:`hyuav.physics.slot.SCHEMES`.
    """
    if not _is_random(system):
        draws = 1
    fading, tasks = (
        _stratified_fading(system, draws, generator),
        _tasks(system, (draws,), generator),
    )
    maps = torch.empty(len(SCHEMES), len(positions), dtype=positions.dtype)
    chunk = max(_CHUNK // (draws * system.scenario.num_ues), 1)
    for part, out in zip(positions.split(chunk), maps.split(chunk, dim=1), strict=True):
        rewards = _rewards(system, part.unsqueeze(1), (len(part), draws), fading, tasks)
        torch.mean(rewards, dim=-1, out=out)
    return maps


def estimate_return(
    system: SecureOffloadingSystem,
    path: Tensor,
    scheme: str,
    draws: int,
    generator: torch.Generator,
) -> tuple[float, float, Tensor]:
    """The expected return of a flight.

    Args:
        system: in float64.
        path: (T + 1, 2) m; the first position is where the flight starts and earns nothing.
        scheme: who chooses the mode.
        draws: of whole episodes.
        generator: of the draws.

    Returns:
        the mean return and its standard error in bps/Hz, and the modes (T,) int64 (1 relay,
        0 jamming) that the scheme takes by expected C_1 and C_0.
    """
    num_slots = len(path) - 1
    draws = draws if _is_random(system) else 1
    chunk = max(_CHUNK // (num_slots * system.scenario.num_ues), 1)
    total = torch.zeros(len(SCHEMES), num_slots, dtype=path.dtype)
    returns = []
    for first in range(0, draws, chunk):
        shape = (min(chunk, draws - first), num_slots)
        fading, tasks = system.draw_fading(shape, generator), _tasks(system, shape, generator)
        rewards = _rewards(system, path[1:], shape, fading, tasks)
        total += rewards.sum(dim=1)
        returns.append(rewards[SCHEMES.index(scheme)].sum(dim=-1))
    episodes = torch.cat(returns)
    error = float(episodes.std()) / math.sqrt(draws) if draws > 1 else 0.0
    relay, jamming = total[SCHEMES.index("relay")], total[SCHEMES.index("jamming")]
    modes = {
        "hybrid": prefers_relay(relay, jamming).to(torch.int64),
        "relay": torch.ones(num_slots, dtype=torch.int64),
        "jamming": torch.zeros(num_slots, dtype=torch.int64),
    }
    return float(episodes.mean()), error, modes[scheme]


def _is_random(system: SecureOffloadingSystem) -> bool:
    return system.scenario.fading or system.edge_can_saturate


def _tasks(
    system: SecureOffloadingSystem, shape: tuple[int, ...], generator: torch.Generator
) -> Tasks | None:
    return system.draw_tasks(shape, generator) if system.edge_can_saturate else None


def _stratified_fading(
    system: SecureOffloadingSystem, draws: int, generator: torch.Generator
) -> Tensor | None:
    """A Latin hypercube of fading powers: (draws, 3 U + 2), or None where fading is off.

    A flight hovers for many slots, so errors of the maps add up over slots instead of averaging
    out. Each link's powers are the means of equally probable strata, shuffled independently:
    the parts of the reward that depend on one link alone are integrated almost without error
    (McKay, Beckman, Conover, Technometrics 21(2), 1979).
    """
    fading = system.draw_fading((draws, _STRATUM), generator)
    if fading is None:
        return None
    links = fading.shape[-1]
    strata = fading.reshape(-1, links).sort(dim=0).values.reshape(draws, _STRATUM, links)
    shuffled = torch.rand((draws, links), generator=generator).argsort(dim=0)
    return strata.mean(dim=1).gather(0, shuffled)


def _rewards(
    system: SecureOffloadingSystem,
    position: Tensor,
    shape: tuple[int, ...],
    fading: Tensor | None,
    tasks: Tasks | None,
) -> Tensor:
    """Rewards at positions that broadcast to (*shape, 2) m: (3, *shape) bps/Hz."""
    if fading is None:  # Otherwise the fading brings its shape to all that follows.
        position = position.expand(*shape, 2)
    distances = system.distances(position)
    gains = system.channel_gains(distances, fading)
    # A UE at D_max is covered (eq. 5), also where float64 puts a grid point just beyond.
    closing = 1e-12 * system.scenario.map_side
    relay = system.relay_outcome(distances - closing, gains, tasks).sum_rate
    jamming = system.jamming_outcome(gains, tasks).sum_rate
    rewards = {"hybrid": torch.maximum(relay, jamming), "relay": relay, "jamming": jamming}
    return torch.stack([rewards[scheme] for scheme in SCHEMES])
