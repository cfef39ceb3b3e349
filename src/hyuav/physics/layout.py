"""Where the nodes are, and random UE layouts for studies beyond the two presets."""

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, Self

import torch
from pydantic import Field
from torch import Tensor

from hyuav._support.parameters import CountOrZero, NonNegativeNumber, checked
from hyuav._support.randomness import derived_seed
from hyuav.physics.scenario import Point, Scenario

MOST_UES = 10**6

NumUEs = Annotated[int, Field(ge=1, le=MOST_UES)]
Sizes = Annotated[
    tuple[NumUEs, ...],
    Field(min_length=1, description="the numbers of UEs of one cluster or more"),
]


class Nodes(NamedTuple):
    """Positions in m by role, for U UEs, H helpers and E eavesdroppers.

    The leading axes (...) of the four are broadcast against each other: where all flights of a
    batch share a layout, the helpers alone have them.
    """

    ue: Tensor
    """(..., U, 2), on the ground."""
    legitimate: Tensor
    """(..., 2), of L."""
    helper: Tensor
    """(..., H, 2)."""
    eavesdropper: Tensor
    """(..., E, 2)."""

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        device: torch.device | str | None = None,
        dtype: torch.dtype = torch.float32,
    ) -> Self:
        """Where a scenario puts its nodes, the helpers at their starts; without leading axes."""
        positions = (
            scenario.ue_positions,
            scenario.legitimate_position,
            scenario.helper_starts,
            scenario.eavesdropper_positions,
        )
        return cls(*(torch.tensor(each, device=device, dtype=dtype) for each in positions))

    @classmethod
    def in_rows(cls, layouts: Sequence[Self], batch_dims: int) -> Self:
        """A layout for each row of a batch's first axis.

        Args:
            layouts: without leading axes, and of equal counts.
            batch_dims: how many axes the batch has; all but the first are of length 1.
        """
        inner = (1,) * (batch_dims - 1)
        rows = (torch.stack(positions) for positions in zip(*layouts, strict=True))
        return cls(*(each.reshape(len(layouts), *inner, *each.shape[1:]) for each in rows))


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
        InputError: ``num_ues`` below 1, ``radius`` below 0, or a value of the wrong type.
    """
    generator = torch.Generator().manual_seed(checked(CountOrZero, "seed", seed))
    num_ues = checked(NumUEs, "num_ues", num_ues)
    radius = checked(NonNegativeNumber, "radius", radius)
    return _disk(num_ues, radius, checked(Point, "center", center), generator)


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
        InputError: no cluster, an empty cluster, a negative length, or a value of the wrong type.
    """
    generator = torch.Generator().manual_seed(checked(CountOrZero, "seed", seed))
    sizes, center = checked(Sizes, "sizes", sizes), checked(Point, "center", center)
    cluster_radius = checked(NonNegativeNumber, "cluster_radius", cluster_radius)
    spread = checked(NonNegativeNumber, "spread", spread)
    exact: dict[str, Any] = {"dtype": torch.float64, "device": generator.device}
    turn = torch.rand((), generator=generator, **exact)
    angles = 2 * torch.pi * (turn + torch.arange(len(sizes), **exact) / len(sizes))
    positions: list[Point] = []
    for size, angle in zip(sizes, angles, strict=True):
        x = center[0] + spread * float(angle.cos())
        y = center[1] + spread * float(angle.sin())
        positions.extend(_disk(size, cluster_radius, (x, y), generator))
    return tuple(positions)


def random_layout(seed: int) -> tuple[Point, ...]:
    """Draw one of a series of layouts of 10 UEs: even seeds draw a disk, odd ones two clusters.

    The clusters' sizes are drawn too, from 3 + 7 to 7 + 3.

    Args:
        seed: the same seed draws the same layout.

    Returns:
        10 positions (x, y) in metres.

    Raises:
        InputError: ``seed`` is negative or of the wrong type.
    """
    seed = checked(CountOrZero, "seed", seed)
    if seed % 2 == 0:
        return disk(10, seed=seed)
    generator = torch.Generator().manual_seed(derived_seed(seed, "cluster sizes"))
    first = int(torch.randint(3, 8, (), generator=generator, device=generator.device))
    return clusters([first, 10 - first], seed=seed)


def _disk(
    num_ues: int, radius: float, center: Point, generator: torch.Generator
) -> tuple[Point, ...]:
    draws = torch.rand(
        (num_ues, 2), generator=generator, dtype=torch.float64, device=generator.device
    )
    x, y = in_disk(draws, radius, center).unbind(dim=-1)
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def in_disk(
    draws: Tensor, radius: Tensor | float, center: tuple[Tensor | float, Tensor | float]
) -> Tensor:
    """Where uniform draws from [0, 1) lie in a disk, uniformly too.

    Args:
        draws: (..., 2), of the distance and the angle.
        radius: in m, of shape (...) or one for all, as x and y of the next.
        center: x and y in m.

    Returns:
        (..., 2) m.
    """
    distance, angle = radius * draws[..., 0].sqrt(), 2 * torch.pi * draws[..., 1]
    x, y = center[0] + distance * angle.cos(), center[1] + distance * angle.sin()
    return torch.stack([x, y], dim=-1)
