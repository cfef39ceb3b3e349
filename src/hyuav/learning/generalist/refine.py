"""A flight made better by local searches with the exact model, the first ones wide and coarse."""

import math
from typing import NamedTuple

import torch

from hyuav.learning.generalist.policy import GeneralistPolicy
from hyuav.physics.slot import Physics
from hyuav.references.flight import FlightPolicy, flyable
from hyuav.references.joint import SeveralHelpers


class Search(NamedTuple):
    """How finely flights are improved, so that all searches take about a second."""

    resolution: float
    """In m, between the places that are tried."""
    power_step: float
    """In dB, between the levels of power."""
    window: float
    """In m, how far a slot's place moves at most."""
    draws: int
    """Of a slot's fading, over which what it brings is averaged."""
    rounds: int
    """How often each helper's flight is improved at most, with the others' held."""


OF_ONE = Search(4.0, 10.0, math.inf, 8, 1), Search(1.0, 5.0, 6.0, 32, 1)
"""For one helper, one after another: one that goes to the lesser of two places is led to the other
by the first, and the second makes it exact."""

OF_SEVERAL = (Search(2.0, 5.0, 4.0, 4, 2),)
"""For several."""


def refined(policy: GeneralistPolicy) -> FlightPolicy:
    """The flight of a policy, improved by dynamic programming in tubes around it."""
    scenario = policy.scenario
    physics = Physics(scenario, dtype=torch.float64)
    plans = [policy.plan()]
    for search in OF_ONE if scenario.num_helpers == 1 else OF_SEVERAL:
        improving = SeveralHelpers(
            physics, search.resolution, search.power_step, search.draws, 0, search.window
        )
        turns = search.rounds * scenario.num_helpers
        plans.append(improving.improved(policy.mode_rule, plans[-1], turns))
    # By few draws a search may prefer what is worse.
    path, share = max(plans, key=policy.expected)
    return FlightPolicy(flyable(path, physics, policy.mode_rule), scenario, share)
