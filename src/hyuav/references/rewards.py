"""Expected rewards over fading and tasks, by Monte Carlo; exact where a slot is not random."""

import math
from collections.abc import Iterator, Sequence

import torch
from torch import Tensor

from hyuav.physics.channel import Links
from hyuav.physics.layout import Nodes
from hyuav.physics.modes import allowed_vectors
from hyuav.physics.slot import Geometry, Physics
from hyuav.physics.tasks import Tasks, draw_tasks

CHUNK = 2**19
"""Links computed at once: few enough for the cache, enough to outweigh PyTorch's overhead."""

_STRATUM = 64
"""Draws whose mean represents a stratum of a link's fading."""


class ExpectedReward:
    """The expected reward of a slot with helpers anywhere.

    Args:
        physics: of the scenario, in float64, or in float32 where rough numbers will do.
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
        chunk = max(CHUNK // (self._draws * scenario.num_ues * several), 1)
        parts = places.split(chunk)
        powers = [None] * len(parts) if power is None else power.split(chunk)
        allowed = [allowed_vectors(rule, scenario.num_helpers) for rule in mode_rules]
        vectors = sorted({vector for own in allowed for vector in own})
        for part, own_power, out in zip(parts, powers, means.split(chunk, dim=1), strict=True):
            sums = self.drawn(vectors, part, own_power)
            for own, mean in zip(allowed, out, strict=True):
                best = sums.amax(dim=0) if len(own) > 1 else sums[vectors.index(own[0])]
                torch.mean(best, dim=-1, out=mean)
        return means

    def drawn(
        self, vectors: Sequence[tuple[bool, ...]], places: Tensor, power: Tensor | None = None
    ) -> Tensor:
        """What slots bring in given modes in each draw: (modes, P, draws) bps/Hz, differentiable.

        Args:
            vectors: the modes.
            places: (P, H, 2) m, like the next as above.
            power: (P, H).
        """
        own = None if power is None else power.unsqueeze(1)
        shape, drawn = (len(places), self._draws), (self._fading, self._tasks)
        return sum_rates(self.physics, vectors, places.unsqueeze(1), shape, *drawn, own)

    def of_flight(self, mode_rule: str, path: Tensor, power: Tensor) -> float:
        """What a flight (T + 1, H, 2) m with powers (T, H) brings under a mode rule, in bps/Hz."""
        return float(self([mode_rule], path[1:], power).sum())


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
    num_slots = len(path) - 1
    vectors = allowed_vectors(mode_rule, physics.scenario.num_helpers)
    total = torch.zeros(len(vectors), num_slots, dtype=path.dtype, device=path.device)
    returns = []
    for shape, fading, tasks in episodes(physics, num_slots, draws, generator):
        sums = sum_rates(physics, vectors, path[1:], shape, fading, tasks, power)
        total += sums.sum(dim=1)
        returns.append(sums.amax(dim=0).sum(dim=-1))
    best = total.max(dim=0).indices  # of equals the first
    modes = torch.tensor(vectors, dtype=torch.int64, device=path.device)
    return *mean_with_error(returns), modes[best]


def episodes(
    physics: Physics, num_slots: int, draws: int, generator: torch.Generator
) -> Iterator[tuple[tuple[int, int], Links | None, Tasks | None]]:
    """The fading and the tasks of whole episodes, as many at once as the cache holds.

    Args:
        physics: in float64.
        num_slots: T.
        draws: how many episodes; where no slot is random, one.
        generator: of the draws.

    Yields:
        the shape (episodes, T), the fading of their links, and their tasks.
    """
    draws = draws if is_random(physics) else 1
    chunk = max(CHUNK // (num_slots * physics.scenario.num_ues), 1)
    for first in range(0, draws, chunk):
        shape = (min(chunk, draws - first), num_slots)
        row = physics.draw_fading(shape, generator)
        fading = None if row is None else physics.link_row.unflatten(row)
        yield shape, fading, tasks_of(physics, shape, generator)


def mean_with_error(returns: Sequence[Tensor]) -> tuple[float, float]:
    """The mean of episodes' returns, given in parts, and its standard error; 0 of a single one."""
    of_all = torch.cat([*returns])
    error = float(of_all.std()) / math.sqrt(len(of_all)) if len(of_all) > 1 else 0.0
    return float(of_all.mean()), error


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
    nodes = nodes_of(physics, position, shape, fading)
    geometry, gains = geometry_of(physics, nodes, fading)
    outcomes = physics.outcomes(geometry, gains, tasks, power, vectors)
    return torch.stack([outcome.sum_rate.expand(shape) for outcome in outcomes])


def nodes_of(
    physics: Physics, position: Tensor, shape: tuple[int, ...], fading: Links | None
) -> Nodes:
    """All nodes of slots (*shape), with the helpers where ``position`` broadcasts to, in m."""
    if fading is None:  # Otherwise the fading brings its shape to all that follows.
        position = position.expand(*shape, *position.shape[-2:])
    return physics.nodes._replace(helper=position)


def geometry_of(physics: Physics, nodes: Nodes, fading: Links | None) -> tuple[Geometry, Links]:
    """The geometry of slots, and the gains of their links with fading.

    A UE at D_max is covered (eq. 5), also where float64 puts a grid point just beyond.
    """
    geometry = physics.geometry(nodes)
    closing = 1e-12 * physics.scenario.map_side
    covering = geometry._replace(ue_to_helper=geometry.ue_to_helper - closing)
    return covering, geometry.gains.faded(fading)


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
