"""Rough flights of all helpers together: what leads those that decide one after another."""

from typing import NamedTuple, Self

import torch
from torch import Tensor

from hyuav.learning.generalist.scene import Others
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.joint import SeveralHelpers


class Coarseness(NamedTuple):
    """How roughly flights are found: first anywhere, then nearby."""

    spacing: float
    """Of the grid in m on which they are found anywhere; who is led by such a flight stays as near
    to it."""
    near: float
    """Of that on which they are then made better in m, at most ``spacing`` away."""
    draws: int
    """Of a slot's fading, over which what it brings is averaged; 1 leaves it out."""
    turns_of_each: int
    """How often each helper's flight is improved at most, with the others' held; nearby three times
    as often, as powers that are too high fall in turn."""


OF_ONE, OF_SEVERAL = Coarseness(4.0, 4.0, 32, 1), Coarseness(20.0, 5.0, 1, 2)
"""For one helper, and for several."""

POWER_STEP = 15.0
"""Between the levels of power that are tried, in dB."""


def coarseness(scenario: Scenario) -> Coarseness:
    """How roughly the flights of a scenario are found."""
    return OF_ONE if scenario.num_helpers == 1 else OF_SEVERAL


class Plan(NamedTuple):
    """A flight of all helpers before it is flown."""

    path: Tensor
    """(T + 1, H, 2) m."""
    share: Tensor
    """(T, H), powers in units of the nominal one."""

    @classmethod
    def roughly_best(cls, scenario: Scenario, mode_rule: str) -> Self:
        """The best rough flight that is found."""
        physics = Physics(scenario, dtype=torch.float64, layout_is_known=False)
        rough = coarseness(scenario)
        anywhere, nearby = (
            SeveralHelpers(physics, spacing, POWER_STEP, rough.draws, seed=0, window=window)
            for spacing, window in (
                (rough.spacing, scenario.map_side),
                (rough.near, rough.spacing),
            )
        )
        turns = rough.turns_of_each * scenario.num_helpers
        plans = [anywhere.best(mode_rule, scenario.num_slots, turns)]
        if scenario.num_helpers > 1:
            # Right above an eavesdropper a helper jams best, which a coarse grid may miss.
            plans += anywhere.straight(scenario.num_slots)
            plans = [nearby.improved(mode_rule, plan, 3 * turns) for plan in plans]
        path, share = max(plans, key=lambda plan: nearby.earned(mode_rule, plan))
        return cls(path.float(), share.float())

    @property
    def at_the_end(self) -> Others:
        """Where the helpers are after the last slot, and their powers in it."""
        return Others(self.path[-1], self.share[-1])
