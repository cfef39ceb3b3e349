"""Generators of layouts: what gives each episode of an environment nodes of its own."""

import dataclasses
from typing import Annotated, Protocol, runtime_checkable

from pydantic import Field, InstanceOf
from pydantic.dataclasses import dataclass
from torch import Tensor

from hyuav._support.parameters import Parameters, parameter
from hyuav.physics.families import DiskLayout, LayoutParameters
from hyuav.physics.layout import Nodes
from hyuav.physics.scenario import Scenario

_KINDS = "a layout such as DiskLayout(), ClustersLayout() or RandomLayout()"


@runtime_checkable
class LayoutGenerator(Protocol):
    """What gives each episode a layout of its own; a scenario stands for always the same.

    An object with these three is taken wherever an environment takes a scenario.
    """

    @property
    def scenario(self) -> Scenario:
        """All that is fixed: parameters, horizon, numbers of nodes and the helpers' starts."""

    @property
    def size(self) -> int:
        """How many uniform draws decide a layout."""

    def draw(self, draws: Tensor) -> Nodes:
        """The nodes of layouts, by tensor operations that use no other random numbers.

        Args:
            draws: (..., size), uniform in [0, 1).

        Returns:
            of the scenario's numbers of nodes, each (..., n, 2) m or without the leading axes where
            it is the same in all. The helpers start at ``scenario.helper_starts``.
        """


@dataclass(frozen=True)
class LayoutFamily(Parameters):
    """Layouts of one kind, drawn anew at each reset of an environment; a :class:`LayoutGenerator`.

    Args:
        layout: which are drawn.
        scenario: all else; its ``ue_positions`` are replaced by an example of the layouts.

    Raises:
        InputError: UEs could be drawn off the map.

    Example:
        >>> env = make_env(LayoutFamily(DiskLayout(num_ues=12)), batch_size=64, seed=0)
        >>> env.reset()["ue_positions"].shape
        torch.Size([64, 12, 2])
    """

    layout: Annotated[InstanceOf[LayoutParameters], Field(description=_KINDS)] = parameter(
        DiskLayout()
    )
    scenario: Scenario = parameter(Scenario.preset("two_clusters"))

    def __post_init__(self) -> None:
        self.layout.require_on_map(self.scenario.map_side)
        example = dataclasses.replace(self.scenario, ue_positions=self.layout.draw(0))
        object.__setattr__(self, "scenario", example)

    @property
    def size(self) -> int:
        """See :attr:`LayoutGenerator.size`."""
        return self.layout.size

    def draw(self, draws: Tensor) -> Nodes:
        """See :meth:`LayoutGenerator.draw`."""
        nodes = Nodes.of(self.scenario, draws.device, draws.dtype)
        return nodes._replace(ue=self.layout.place(draws))


@dataclasses.dataclass(frozen=True)
class _OverHorizon:
    generator: LayoutGenerator
    num_slots: int

    @property
    def scenario(self) -> Scenario:
        return dataclasses.replace(self.generator.scenario, num_slots=self.num_slots)

    @property
    def size(self) -> int:
        return self.generator.size

    def draw(self, draws: Tensor) -> Nodes:
        return self.generator.draw(draws)


def over_horizon(
    scenario: Scenario | LayoutGenerator, num_slots: int
) -> Scenario | LayoutGenerator:
    """The same over a horizon of ``num_slots``."""
    if isinstance(scenario, LayoutGenerator):
        return _OverHorizon(scenario, num_slots)
    return dataclasses.replace(scenario, num_slots=num_slots)
