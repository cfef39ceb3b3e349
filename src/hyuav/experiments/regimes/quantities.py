"""What a map of regimes can vary: a number of the scenario, or how far its nodes are apart."""

import dataclasses
import math
import typing
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import declared
from hyuav.physics.scenario import Point, Scenario


class Quantity(NamedTuple):
    """A number that a scenario has, and that it can have instead."""

    of: Callable[[Scenario], float]
    """The number in a scenario."""
    changed: Callable[[Scenario, float], Scenario]
    """The scenario with another number; raises an ``InputError`` where that is not accepted."""
    unit: str
    """Empty for none."""
    is_whole: bool = False
    """Whether only whole numbers are accepted."""


def _fields() -> dict[str, Quantity]:
    """The fields of :class:`Scenario` that are a single number."""
    kinds = {
        name: declared(annotation).annotation
        for name, annotation in typing.get_type_hints(Scenario, include_extras=True).items()
    }
    return {
        field.name: Quantity(
            partial(_field, field.name),
            partial(_with_field, field.name),
            field.metadata["unit"],
            is_whole=kinds[field.name] is int,
        )
        for field in dataclasses.fields(Scenario)
        if kinds[field.name] in (int, float)
    }


def _field(name: str, scenario: Scenario) -> float:
    return float(getattr(scenario, name))


def _with_field(name: str, scenario: Scenario, value: float) -> Scenario:
    changed: Any = {name: round(value) if isinstance(getattr(scenario, name), int) else value}
    return dataclasses.replace(scenario, **changed)


def _eavesdropper_distance(scenario: Scenario) -> float:
    return math.dist(scenario.eavesdropper_positions[0], scenario.legitimate_position)


def _with_eavesdropper_distance(scenario: Scenario, metres: float) -> Scenario:
    """Move each eavesdropper along its direction from L."""
    center, moved = scenario.legitimate_position, []
    for position in scenario.eavesdropper_positions:
        away = math.dist(position, center)
        if away == 0.0:
            accepted = "a position with a direction from L, not that of L itself"
            raise InputError(rejection("eavesdropper_positions", position, accepted))
        moved.append(_scaled(position, center, metres / away))
    return dataclasses.replace(scenario, eavesdropper_positions=tuple(moved))


def _with_ue_spread(scenario: Scenario, factor: float) -> Scenario:
    """Move all UEs so that their distances from L are so many times what they were."""
    center = scenario.legitimate_position
    moved = tuple(_scaled(position, center, factor) for position in scenario.ue_positions)
    return dataclasses.replace(scenario, ue_positions=moved)


def _scaled(position: Point, center: Point, factor: float) -> Point:
    x, y = (middle + factor * (own - middle) for own, middle in zip(position, center, strict=True))
    return x, y


QUANTITIES = {
    **_fields(),
    "eavesdropper_distance": Quantity(_eavesdropper_distance, _with_eavesdropper_distance, "m"),
    "ue_spread": Quantity(lambda _: 1.0, _with_ue_spread, ""),
}
"""By name: the scenario's numbers; the eavesdropper's horizontal distance from L, along its own
direction; and the UEs' distances from L, in units of those that the scenario has."""
