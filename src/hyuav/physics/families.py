"""Layouts by their parameters, which a seed or uniform draws decide."""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass
from torch import Tensor

from hyuav._support.errors import InputError, rejection, require_choice
from hyuav._support.parameters import (
    CountOrZero,
    NonNegativeNumber,
    Parameters,
    checked,
    parameter,
)
from hyuav.physics.layout import (
    MOST_UES,
    NumUEs,
    Sizes,
    clusters,
    disk,
    in_disk,
    random_layout,
)
from hyuav.physics.scenario import Point, Scenario

_NumClusters = Annotated[int, Field(ge=1, le=MOST_UES)]


class LayoutParameters(Parameters, ABC):
    """What decides a layout besides its seed."""

    lengths: ClassVar[tuple[str, ...]] = ()
    """The fields in m that reach from the layout's center to its edge, one after another."""

    @abstractmethod
    def draw(self, seed: int) -> tuple[Point, ...]:
        """Draw U positions (x, y) in metres; the same seed draws the same."""

    @property
    @abstractmethod
    def size(self) -> int:
        """How many uniform draws decide a layout."""

    @abstractmethod
    def place(self, draws: Tensor) -> Tensor:
        """Where uniform draws (..., size) from [0, 1) put the UEs: (..., U, 2) m."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """How far from the middle of the map UEs may be along x or y, in m."""

    def require_on_map(self, map_side: float) -> None:
        """Accept a map that holds the layout, whatever is drawn.

        Args:
            map_side: l_max in m.

        Raises:
            InputError: it does not.
        """
        if self.extent <= map_side / 2:
            return
        if not self.lengths:
            accepted = f"at least {2 * self.extent:g} m for this layout"
            raise InputError(rejection("map_side", map_side, accepted))
        name = max(self.lengths, key=lambda length: float(getattr(self, length)))
        sum_of_all = " + ".join(("center", *self.lengths))
        accepted = f"{sum_of_all} within the map, at most {map_side / 2:g} m from its middle"
        raise InputError(rejection(name, getattr(self, name), accepted))


@dataclass(frozen=True)
class DiskLayout(LayoutParameters):
    """UEs uniform in a disk; see :func:`hyuav.physics.layout.disk`."""

    num_ues: NumUEs = parameter(10, symbol="U")
    radius: NonNegativeNumber = parameter(45.0, unit="m")
    center: Point = parameter((0.0, 0.0), unit="m")

    lengths = ("radius",)

    def draw(self, seed: int) -> tuple[Point, ...]:
        """See :meth:`LayoutParameters.draw`."""
        return disk(self.num_ues, self.radius, self.center, seed=seed)

    @property
    def size(self) -> int:
        """See :attr:`LayoutParameters.size`."""
        return 2 * self.num_ues

    def place(self, draws: Tensor) -> Tensor:
        """See :meth:`LayoutParameters.place`."""
        return in_disk(draws.unflatten(-1, (-1, 2)), self.radius, self.center)

    @property
    def extent(self) -> float:
        """See :attr:`LayoutParameters.extent`."""
        return max(map(abs, self.center)) + self.radius


@dataclass(frozen=True)
class ClustersLayout(LayoutParameters):
    """UEs in clusters around a circle; see :func:`hyuav.physics.layout.clusters`."""

    num_ues: NumUEs = parameter(10, symbol="U")
    num_clusters: _NumClusters = parameter(2)
    """Of sizes as equal as can be, the larger ones first."""
    sizes: Sizes | None = parameter(None)
    """The number of UEs of each cluster, in place of ``num_ues`` and ``num_clusters``."""
    cluster_radius: NonNegativeNumber = parameter(15.0, unit="m")
    spread: NonNegativeNumber = parameter(30.0, unit="m")
    """Distance of the clusters' centers from ``center``."""
    center: Point = parameter((0.0, 0.0), unit="m")

    lengths = ("spread", "cluster_radius")

    def __post_init__(self) -> None:
        if self.sizes is None:
            if self.num_clusters > self.num_ues:
                accepted = f"at most num_ues = {self.num_ues}, a UE in each cluster"
                raise InputError(rejection("num_clusters", self.num_clusters, accepted))
            return
        if sum(self.sizes) > MOST_UES:
            raise InputError(rejection("sizes", self.sizes, f"at most {MOST_UES} UEs in all"))
        counts = {"num_ues": sum(self.sizes), "num_clusters": len(self.sizes)}
        for name, count in counts.items():
            if (own := getattr(self, name)) not in (count, _default(type(self), name)):
                raise InputError(rejection(name, own, f"{count}, as sizes have it, or no {name}"))

    @property
    def cluster_sizes(self) -> tuple[int, ...]:
        """The number of UEs of each cluster."""
        if self.sizes is not None:
            return self.sizes
        least, larger = divmod(self.num_ues, self.num_clusters)
        return tuple(least + (index < larger) for index in range(self.num_clusters))

    def draw(self, seed: int) -> tuple[Point, ...]:
        """See :meth:`LayoutParameters.draw`."""
        sizes = self.cluster_sizes
        return clusters(sizes, self.cluster_radius, self.spread, self.center, seed=seed)

    @property
    def size(self) -> int:
        """See :attr:`LayoutParameters.size`."""
        return 1 + 2 * sum(self.cluster_sizes)

    def place(self, draws: Tensor) -> Tensor:
        """See :meth:`LayoutParameters.place`."""
        sizes = torch.tensor(self.cluster_sizes, device=draws.device)
        own = torch.arange(len(sizes), device=draws.device).repeat_interleave(sizes)
        return self.around(draws[..., :1], own / len(sizes), draws[..., 1:])

    def around(self, turn: Tensor, share: Tensor, draws: Tensor) -> Tensor:
        """UEs (..., U, 2) m in clusters around the circle of this layout.

        Args:
            turn: (..., 1), of the circle, in whole turns.
            share: (..., U), how far around it each UE's cluster lies, in whole turns too.
            draws: (..., 2 U), where in its cluster.
        """
        angle = 2 * torch.pi * (turn + share)
        x = self.center[0] + self.spread * angle.cos()
        y = self.center[1] + self.spread * angle.sin()
        return in_disk(draws.unflatten(-1, (-1, 2)), self.cluster_radius, (x, y))

    @property
    def extent(self) -> float:
        """See :attr:`LayoutParameters.extent`."""
        return max(map(abs, self.center)) + self.spread + self.cluster_radius


@dataclass(frozen=True)
class RandomLayout(LayoutParameters):
    """10 UEs in a disk or two clusters; see :func:`hyuav.physics.layout.random_layout`."""

    def draw(self, seed: int) -> tuple[Point, ...]:
        """See :meth:`LayoutParameters.draw`."""
        return random_layout(seed)

    @property
    def size(self) -> int:
        """See :attr:`LayoutParameters.size`."""
        return 2 + ClustersLayout().size

    def place(self, draws: Tensor) -> Tensor:
        """See :meth:`LayoutParameters.place`."""
        kind, first, turn, within = draws.split((1, 1, 1, self.size - 3), dim=-1)
        second = torch.arange(10, device=draws.device) >= 3 + (5 * first).floor()
        two = ClustersLayout().around(turn, 0.5 * second, within)
        return torch.where(kind.unsqueeze(-1) < 0.5, DiskLayout().place(within), two)

    @property
    def extent(self) -> float:
        """See :attr:`LayoutParameters.extent`."""
        return max(DiskLayout().extent, ClustersLayout().extent)


LAYOUTS: dict[str, type[LayoutParameters]] = {
    "disk": DiskLayout,
    "clusters": ClustersLayout,
    "random_layout": RandomLayout,
}
"""By the names under which they are asked for."""


def drawn_scenario(values: Mapping[str, Any]) -> tuple[Scenario, int]:
    """A scenario whose UEs are drawn, and the seed that drew them.

    Args:
        values: ``layout``, a name of :data:`LAYOUTS`; where they are given, the fields of that
            layout and ``seed`` (0); and fields of the scenario.

    Raises:
        InputError: an unknown layout or field, an unacceptable value, or UEs off the map.
    """
    fields = dict(values)
    require_choice("layout", name := fields.pop("layout"), LAYOUTS)
    seed = checked(CountOrZero, "seed", fields.pop("seed", 0))
    own = {field.name for field in dataclasses.fields(LAYOUTS[name])} & fields.keys()
    layout = LAYOUTS[name].from_dict({field: fields.pop(field) for field in own})
    if "ue_positions" in fields:
        accepted = f"none, since they are drawn: layout is {name}"
        raise InputError(rejection("ue_positions", fields["ue_positions"], accepted))
    scenario = Scenario.from_dict({"ue_positions": ((0.0, 0.0),), **fields})
    layout.require_on_map(scenario.map_side)
    return dataclasses.replace(scenario, ue_positions=layout.draw(seed)), seed


def _default(owner: type[Parameters], name: str) -> Any:
    return next(field.default for field in dataclasses.fields(owner) if field.name == name)
