"""Rough flights of all helpers together: what leads those that decide one after another."""

from typing import NamedTuple, Self

import torch
from torch import Tensor

from hyuav.learning.generalist.scene import Others
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.joint import SeveralHelpers


class Coarseness(NamedTuple):
    """How roughly flights are found anywhere on the map."""

    spacing: float
    """Of the grid in m; who is led by such a flight stays as near to it."""
    draws: int
    """Of a slot's fading, over which what it brings is averaged; 1 leaves it out."""


OF_ONE, OF_SEVERAL = Coarseness(4.0, 32), Coarseness(20.0, 1)
"""For one helper, and for several."""

NEAR = 5.0
"""Of the grid in m on which flights of several helpers are made better nearby."""

TURNS_OF_EACH, TURNS_NEARBY = 2, 6
"""How often each of several helpers' flights is improved at most, with the others' held: anywhere,
and nearby, where powers that are too high fall in turn."""

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
        spacing, draws = coarseness(scenario)
        anywhere = SeveralHelpers(
            physics, spacing, POWER_STEP, draws, seed=0, window=scenario.map_side
        )
        straight = list(anywhere.straight(scenario.num_slots))
        if scenario.num_helpers == 1:  # whose program does not depend on where it begins
            path, share = anywhere.improved(mode_rule, straight[0], turns=1)
            return cls(path.float(), share.float())
        turns = TURNS_OF_EACH * scenario.num_helpers
        found = anywhere.best(mode_rule, scenario.num_slots, turns)
        nearby = SeveralHelpers(physics, NEAR, POWER_STEP, draws, seed=0, window=spacing)
        turns = TURNS_NEARBY * scenario.num_helpers
        # Right above an eavesdropper a helper jams best, which a coarse grid may miss.
        plans = [nearby.improved(mode_rule, plan, turns) for plan in (found, *straight)]
        path, share = max(plans, key=lambda plan: nearby.earned(mode_rule, plan))
        return cls(path.float(), share.float())

    @property
    def at_the_end(self) -> Others:
        """Where the helpers are after the last slot, and their powers in it."""
        return Others(self.path[-1], self.share[-1])
