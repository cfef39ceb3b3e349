"""Expected rewards over fading and tasks, by Monte Carlo; exact where a slot is not random."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav.physics.channel import Links
from hyuav.physics.modes import allowed_vectors
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import Tasks, draw_tasks

_CHUNK = 2**19
"""Links computed at once: few enough for the cache, enough to outweigh PyTorch's overhead."""

_STRATUM = 64
"""Draws whose mean represents a stratum of a link's fading."""


class ExpectedReward:
    """The expected reward of a slot with helpers anywhere.

    Args:
        physics: in float64.
        draws: of fading and tasks that are averaged over, the same everywhere and stratified; 1
            leaves fading out.
        generator: of the draws.
    """

    def __init__(self, physics: Physics, draws: int, generator: torch.Generator) -> None:
        self.physics = physics
        self._draws = draws = draws if is_random(physics) else 1
        self._fading = stratified_fading(physics, draws, generator) if draws > 1 else None
        self._tasks = tasks_of(physics, (draws,), generator)

    def __call__(
        self, mode_rules: Sequence[str], places: Tensor, power: Tensor | None = None
    ) -> Tensor:
        """What slots bring under each mode rule: (len(mode_rules), P) bps/Hz.

        Args:
            mode_rules: who chooses the modes.
            places: (P, H, 2) m, of the helpers.
            power: (P, H), in units of the nominal power; None for that.
        """
        scenario = self.physics.scenario
        means = torch.empty(len(mode_rules), len(places), dtype=places.dtype, device=places.device)
        several = 4 ** (scenario.num_helpers - 1)
        chunk = max(_CHUNK // (self._draws * scenario.num_ues * several), 1)
        parts = places.split(chunk)
        powers = [None] * len(parts) if power is None else power.split(chunk)
        for part, own, out in zip(parts, powers, means.split(chunk, dim=1), strict=True):
            rewards = rewards_of(
                self.physics,
                mode_rules,
                part.unsqueeze(1),
                (len(part), self._draws),
                self._fading,
                self._tasks,
                None if own is None else own.unsqueeze(1),
            )
            torch.mean(rewards, dim=-1, out=out)
        return means


def estimate_return(
    physics: Physics,
    path: Tensor,
    mode_rule: str,
    draws: int,
    generator: torch.Generator,
    power: Tensor | None = None,
) -> tuple[float, float, Tensor]:
    """The expected return of a flight.

    Args:
        physics: in float64.
        path: (T + 1, H, 2) m; the first positions are where the flight starts and earn nothing.
        mode_rule: who chooses the modes.
        draws: of whole episodes.
        generator: of the draws.
        power: (T, H), in units of the nominal power; None for that.

    Returns:
        the mean return and its standard error in bps/Hz, and the modes (T, H) int64 (1
        relay, 0 jamming) that the mode rule takes by what each brings in the mean.
    """
    scenario, num_slots = physics.scenario, len(path) - 1
    draws = draws if is_random(physics) else 1
    vectors = allowed_vectors(mode_rule, scenario.num_helpers)
    chunk = max(_CHUNK // (num_slots * scenario.num_ues), 1)
    total = torch.zeros(len(vectors), num_slots, dtype=path.dtype, device=path.device)
    returns = []
    for first in range(0, draws, chunk):
        shape = (min(chunk, draws - first), num_slots)
        row = physics.draw_fading(shape, generator)
        fading = None if row is None else physics.link_row.unflatten(row)
        tasks = tasks_of(physics, shape, generator)
        sums = sum_rates(physics, vectors, path[1:], shape, fading, tasks, power)
        total += sums.sum(dim=1)
        returns.append(sums.amax(dim=0).sum(dim=-1))
    episodes = torch.cat(returns)
    error = float(episodes.std()) / math.sqrt(draws) if draws > 1 else 0.0
    best = total.max(dim=0).indices  # of equals the first
    modes = torch.tensor(vectors, dtype=torch.int64, device=path.device)
    return float(episodes.mean()), error, modes[best]


def rewards_of(
    physics: Physics,
    mode_rules: Sequence[str],
    position: Tensor,
    shape: tuple[int, ...],
    fading: Links | None,
    tasks: Tasks | None,
    power: Tensor | None = None,
) -> Tensor:
    """Rewards under each mode rule; the rest as for :func:`sum_rates`: (rules, *shape) bps/Hz."""
    num_helpers = physics.scenario.num_helpers
    allowed = [allowed_vectors(rule, num_helpers) for rule in mode_rules]
    vectors = sorted({vector for own in allowed for vector in own})
    sums = sum_rates(physics, vectors, position, shape, fading, tasks, power)
    return torch.stack(
        [sums.amax(dim=0) if len(own) > 1 else sums[vectors.index(own[0])] for own in allowed]
    )


def sum_rates(
    physics: Physics,
    vectors: Sequence[tuple[bool, ...]],
    position: Tensor,
    shape: tuple[int, ...],
    fading: Links | None,
    tasks: Tasks | None,
    power: Tensor | None = None,
) -> Tensor:
    """The sum-rates C_k of slots in given modes: (modes, *shape) bps/Hz.

    Args:
        physics: in float64.
        vectors: the modes.
        position: of the helpers, broadcast to (*shape, H, 2) m.
        shape: of the slots.
        fading: of their links.
        tasks: of the UEs.
        power: (*shape, H) likewise, in units of the nominal power; None for that.
    """
    if fading is None:  # Otherwise the fading brings its shape to all that follows.
        position = position.expand(*shape, *position.shape[-2:])
    geometry = physics.geometry(physics.nodes._replace(helper=position))
    gains = geometry.gains.faded(fading)
    # A UE at D_max is covered (eq. 5), also where float64 puts a grid point just beyond.
    closing = 1e-12 * physics.scenario.map_side
    geometry = geometry._replace(ue_to_helper=geometry.ue_to_helper - closing)
    outcomes = physics.outcomes(geometry, gains, tasks, power, vectors)
    return torch.stack([outcome.sum_rate.expand(shape) for outcome in outcomes])


def is_random(physics: Physics) -> bool:
    """Whether a slot's reward depends on what is drawn."""
    return physics.scenario.fading or physics.edge_can_saturate


def tasks_of(physics: Physics, shape: tuple[int, ...], generator: torch.Generator) -> Tasks | None:
    """Draws of the UEs' tasks, (*shape, U); None where they cannot fill the edge server."""
    if not physics.edge_can_saturate:
        return None
    return draw_tasks(physics.scenario, shape, generator, physics.dtype)


def stratified_fading(physics: Physics, draws: int, generator: torch.Generator) -> Links | None:
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
