"""What a map of regimes covers, and how exactly each of its points is solved."""

from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from hyuav._support.errors import InputError, rejection
from hyuav._support.machine import cores
from hyuav._support.parameters import (
    LARGEST_COUNT,
    CountOrZero,
    Number,
    OneOf,
    Parameters,
    PositiveNumber,
    Text,
    Threads,
    parameter,
)
from hyuav.experiments.regimes.quantities import QUANTITIES, Quantity
from hyuav.physics.scenario import Scenario
from hyuav.references.optimum import PowerStep, require_resolution

Draws = Annotated[int, Field(ge=2, le=LARGEST_COUNT)]


@dataclass(frozen=True)
class Axis(Parameters):
    """One of the two parameters that are swept."""

    field: Annotated[str, OneOf(*QUANTITIES)] = parameter("jamming_power")
    """A number of the scenario; ``eavesdropper_distance`` from L in m, along its own direction; or
    ``ue_spread``, the UEs' distances from L in units of the scenario's."""
    low: Number = parameter(1e-6)
    high: Number = parameter(0.1)
    points: Annotated[int, Field(ge=2, le=1000)] = parameter(20)
    scale: Annotated[str, OneOf("linear", "log")] = parameter("log")

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(rejection("high", self.high, f"a number > low = {self.low:g}"))
        if self.scale == "log" and self.low <= 0.0:
            raise InputError(rejection("low", self.low, "a number > 0, or scale=linear"))
        if len(set(self.values)) < self.points:
            accepted = f"at most {len(set(self.values))}, the whole numbers from low to high"
            raise InputError(rejection("points", self.points, accepted))

    @property
    def quantity(self) -> Quantity:
        """What is swept."""
        return QUANTITIES[self.field]

    @property
    def values(self) -> list[float]:
        """The numbers that are tried, from low to high."""
        spaced = np.geomspace if self.scale == "log" else np.linspace
        values = spaced(self.low, self.high, self.points)
        found: list[float] = (values.round() if self.quantity.is_whole else values).tolist()
        return found


class MapPoint(NamedTuple):
    """A point of the map."""

    x: float
    y: float
    scenario: Scenario


@dataclass(frozen=True)
class Axes(Parameters):
    """Both parameters that are swept."""

    x: Axis = parameter()
    y: Axis = parameter()

    def __post_init__(self) -> None:
        if self.x.field == self.y.field:
            accepted = f"another field than x.field = {self.x.field}"
            raise InputError(rejection("y.field", self.y.field, accepted))

    def lines(self, scenario: Scenario) -> list[list[MapPoint]]:
        """The map's points, a list for each value of y, from low to high.

        Args:
            scenario: that has all other parameters.

        Raises:
            InputError: one does not accept a value.
        """
        for name, axis in (("x", self.x), ("y", self.y)):
            for end in ("low", "high"):
                _changed(scenario, axis, getattr(axis, end), f"{name}.{end}")
        along_y = [(y, _changed(scenario, self.y, y, self.y.field)) for y in self.y.values]
        return [
            [MapPoint(x, y, _changed(moved, self.x, x, self.x.field)) for x in self.x.values]
            for y, moved in along_y
        ]


def _changed(scenario: Scenario, axis: Axis, value: float, name: str) -> Scenario:
    """A scenario with another value of what is swept, by the name of which it is refused."""
    try:
        return axis.quantity.changed(scenario, value)
    except InputError as error:
        raise InputError(
            rejection(name, value, f"a value that the scenario takes ({error})")
        ) from None


@dataclass(frozen=True)
class Regimes(Parameters):
    """How exactly each point of the map is solved, and how the work is divided."""

    resolution: PositiveNumber = parameter(5.0, unit="m")
    """Of the grid of the helper's positions."""
    power_step: PowerStep = parameter(5.0, unit="dB")
    """Between the levels of power that are tried."""
    draws: Draws = parameter(32)
    """Of a slot's fading, by which flights are chosen."""
    evaluation_draws: Draws = parameter(1000)
    """Of whole episodes, the same at each point, in which the chosen flights are flown."""
    seed: CountOrZero = parameter(0)
    workers: Threads = parameter(cores())
    """Processes that work at the same time, by default as many as cores."""
    retries: CountOrZero = parameter(2)
    """How often a line of the map is begun again whose process was killed."""
    output: Text = parameter("runs/${now:%Y-%m-%d_%H-%M-%S}_regimes")
    """Directory of the map, which may have been begun."""

    def require_usable(self, scenario: Scenario) -> None:
        """Accept a scenario whose tables fit the memory at this resolution.

        Raises:
            InputError: they do not.
        """
        require_resolution(self.resolution, scenario.map_side, scenario.num_slots)
