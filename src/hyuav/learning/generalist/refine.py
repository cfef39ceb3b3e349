"""A flight made better by a local search with the exact model."""

from typing import NamedTuple

import torch

from hyuav.learning.generalist.policy import GeneralistPolicy
from hyuav.physics.slot import Physics
from hyuav.references.flight import FlightPolicy, flyable
from hyuav.references.joint import SeveralHelpers


class Search(NamedTuple):
    """How finely flights are improved, so that it takes about a second."""

    resolution: float
    """In m, between the places that are tried."""
    power_step: float
    """In dB, between the levels of power."""
    window: float
    """In m, how far a slot's place moves at most."""
    draws: int
    """Of a slot's fading, over which what it brings is averaged."""


OF_ONE, OF_SEVERAL = Search(1.0, 3.0, 10.0, 8), Search(2.0, 5.0, 4.0, 4)
"""For one helper, and for several."""


def refined(policy: GeneralistPolicy) -> FlightPolicy:
    """The flight of a policy, improved by dynamic programming in a tube around it.

    Of several helpers each flies twice more at most, with the others held.
    """
    scenario = policy.scenario
    search = OF_ONE if scenario.num_helpers == 1 else OF_SEVERAL
    physics = Physics(scenario, dtype=torch.float64)
    improving = SeveralHelpers(
        physics, search.resolution, search.power_step, search.draws, 0, search.window
    )
    path, share = improving.improved(policy.mode_rule, policy.plan(), 2 * scenario.num_helpers)
    return FlightPolicy(flyable(path, physics, policy.mode_rule), scenario, share)
