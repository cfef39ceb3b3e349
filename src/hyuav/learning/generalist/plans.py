"""Rough flights of all helpers together: what leads those that decide one after another."""

from collections.abc import Iterable
from typing import NamedTuple

import torch

from hyuav.learning.generalist.scene import DRAWS, Others
from hyuav.physics.modes import allowed_vectors
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.ascent import Ascent
from hyuav.references.joint import Plan, SeveralHelpers
from hyuav.references.rewards import ExpectedReward


class Coarseness(NamedTuple):
    """How roughly flights are found anywhere on the map."""

    spacing: float
    """Of the grid in m; who is led by such a flight stays as near to it."""
    draws: int
    """Of a slot's fading, over which what it brings is averaged; 1 leaves it out."""


OF_ONE, OF_SEVERAL = Coarseness(4.0, 32), Coarseness(20.0, 32)
"""For one helper, and for several, whose draws are shared among the modes that a rule allows."""

CLIMBING_DRAWS = 8
"""Of a slot's fading, by whose mean the flights of several helpers climb."""

TURNS_OF_EACH = 2
"""How often each of several helpers' flights is improved at most, with the others' held."""

QUIETLY = 1e-3
"""The power, in units of the nominal one, at which straight flights are begun too."""

POWER_STEP = 15.0
"""Between the levels of power that are tried, in dB."""

NEAR, WINDOW, FINE_STEP, FEW_DRAWS = 4.0, 8.0, 5.0, 4
"""Of the last search nearby: the grid's spacing in m, how far in m a slot's place moves at most,
the step in dB between levels of power, and the draws of a slot's fading."""

FEW_MODES = 4
"""That may be chosen in a slot, those of two helpers, for which all draws are taken."""


def coarseness(scenario: Scenario) -> Coarseness:
    """How roughly the flights of a scenario are found."""
    return OF_ONE if scenario.num_helpers == 1 else OF_SEVERAL


def shared_draws(scenario: Scenario, mode_rule: str, draws: int, modes: int = FEW_MODES) -> int:
    """How many draws of the fading are left to each of the modes that a rule allows, 1 at least.

    The best one of many modes rests less on fading, and takes as long as all of them.

    Args:
        scenario: that is flown.
        mode_rule: who chooses the modes.
        draws: that each mode has where there are few.
        modes: how many count as few; more share what these would have together.
    """
    vectors = len(allowed_vectors(mode_rule, scenario.num_helpers))
    return max(draws * modes // max(vectors, modes), 1)


def roughly_best(scenario: Scenario, mode_rule: str) -> Plan:
    """The best rough flight that is found."""
    physics = Physics(scenario, dtype=torch.float32, layout_is_known=False)
    spacing, draws = coarseness(scenario)
    if scenario.num_helpers > 1:
        draws = shared_draws(scenario, mode_rule, draws, modes=1)
    anywhere = SeveralHelpers(physics, spacing, POWER_STEP, draws, seed=0, window=scenario.map_side)
    straight = list(anywhere.straight(scenario.num_slots))
    if scenario.num_helpers == 1:  # whose program does not depend on where it begins
        return anywhere.improved(mode_rule, straight[0], turns=1)
    turns = TURNS_OF_EACH * scenario.num_helpers
    if scenario.num_helpers == 2:
        rough = [anywhere.best(mode_rule, scenario.num_slots, turns)]
    else:
        rough = [anywhere.improved(mode_rule, plan, turns) for plan in straight]
    if scenario.power_control:  # who is overheard at full power finds no way down from there
        straight += [Plan(path, QUIETLY * share) for path, share in straight]
    plans = climbed(scenario, mode_rule, [*rough, *straight])
    judging = ExpectedReward(physics, 4 * DRAWS, torch.Generator().manual_seed(2))
    return max(plans, key=lambda plan: judging.of_flight(mode_rule, *plan))


def at_the_end(plan: Plan) -> Others:
    """Where the helpers are after the last slot, and their powers in it."""
    return Others(plan.path[-1], plan.share[-1])


def climbed(scenario: Scenario, mode_rule: str, plans: Iterable[Plan]) -> list[Plan]:
    """Flights made better by the gradient of what they bring."""
    physics = Physics(scenario, dtype=torch.float32, layout_is_known=False)
    ascent = Ascent(physics, mode_rule, CLIMBING_DRAWS, seed=1)
    return ascent.improved([*plans])


def settled(scenario: Scenario, mode_rule: str, plan: Plan) -> list[Plan]:
    """A flight as it is, after each helper's program nearby, and after another climb from there."""
    physics = Physics(scenario, dtype=torch.float32, layout_is_known=False)
    draws = shared_draws(scenario, mode_rule, FEW_DRAWS)
    nearby = SeveralHelpers(physics, NEAR, FINE_STEP, draws, seed=0, window=WINDOW)
    found = nearby.improved(mode_rule, plan, TURNS_OF_EACH * scenario.num_helpers)
    return [plan, found, *climbed(scenario, mode_rule, [found])]
