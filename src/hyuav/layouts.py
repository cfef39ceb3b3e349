"""Random UE layouts, for studies beyond the two presets."""

from collections.abc import Sequence

import torch

from hyuav.errors import InputError, rejection
from hyuav.scenario import Point


def disk(
    num_ues: int, radius: float = 45.0, center: Point = (0.0, 0.0), *, seed: int
) -> tuple[Point, ...]:
    """Draw UE positions uniformly in a disk.

    Args:
        num_ues: U, at least 1.
        radius: of the disk in metres, at least 0.
        center: of the disk in metres.
        seed: the same seed draws the same layout.

    Returns:
        U positions (x, y) in metres, for :attr:`Scenario.ue_positions`.

    Raises:
        InputError: ``num_ues`` below 1 or ``radius`` below 0.
    """
    return _disk(num_ues, radius, center, torch.Generator().manual_seed(seed))


def clusters(
    sizes: Sequence[int],
    cluster_radius: float = 15.0,
    spread: float = 30.0,
    center: Point = (0.0, 0.0),
    *,
    seed: int,
) -> tuple[Point, ...]:
    """Draw UE clusters: centers evenly spaced on a randomly turned circle, UEs uniform around them.

    Args:
        sizes: the number of UEs of each cluster, each at least 1.
        cluster_radius: of each cluster in metres.
        spread: distance of the cluster centers from ``center`` in metres.
        center: of the layout in metres.
        seed: the same seed draws the same layout.

    Returns:
        sum(sizes) positions (x, y) in metres, cluster by cluster.

    Raises:
        InputError: no cluster, an empty cluster, or a negative length.
    """
    if not sizes:
        raise InputError(rejection("sizes", sizes, "the size of at least one cluster"))
    if spread < 0:
        raise InputError(rejection("spread", spread, "a length >= 0 m"))
    generator = torch.Generator().manual_seed(seed)
    turn = torch.rand((), generator=generator, dtype=torch.float64)
    angles = 2 * torch.pi * (turn + torch.arange(len(sizes), dtype=torch.float64) / len(sizes))
    positions: list[Point] = []
    for size, angle in zip(sizes, angles, strict=True):
        x = center[0] + spread * float(angle.cos())
        y = center[1] + spread * float(angle.sin())
        positions.extend(_disk(size, cluster_radius, (x, y), generator))
    return tuple(positions)


def _disk(
    num_ues: int, radius: float, center: Point, generator: torch.Generator
) -> tuple[Point, ...]:
    if num_ues < 1:
        raise InputError(rejection("num_ues", num_ues, "a whole number >= 1"))
    if radius < 0:
        raise InputError(rejection("radius", radius, "a length >= 0 m"))
    draws = torch.rand((num_ues, 2), generator=generator, dtype=torch.float64)
    distance, angle = radius * draws[:, 0].sqrt(), 2 * torch.pi * draws[:, 1]
    x, y = center[0] + distance * angle.cos(), center[1] + distance * angle.sin()
    return tuple(zip(x.tolist(), y.tolist(), strict=True))
