"""A flight made better by a local search with the exact model."""

import torch

from hyuav.learning.generalist.policy import GeneralistPolicy
from hyuav.physics.slot import Physics
from hyuav.references.flight import FlightPolicy, flyable
from hyuav.references.joint import SeveralHelpers

RESOLUTION, POWER_STEP, WINDOW = (
    {True: 1.0, False: 2.0},
    {True: 2.0, False: 5.0},
    {
        True: 10.0,
        False: 4.0,
    },
)
"""For one helper and for several: the spacing of the places that are tried in m, the step between
the levels of power in dB, and how far places may move at a time in m."""


def refined(policy: GeneralistPolicy) -> FlightPolicy:
    """The flight of a policy, improved by dynamic programming in a tube around it.

    Of several helpers each flies once more, with the others held.
    """
    scenario = policy.scenario
    one = scenario.num_helpers == 1
    physics = Physics(scenario, dtype=torch.float64)
    search = SeveralHelpers(physics, RESOLUTION[one], POWER_STEP[one], 1, 0, WINDOW[one])
    path, share = search.improved(policy.mode_rule, policy.plan(), 2 * scenario.num_helpers)
    return FlightPolicy(flyable(path, physics, policy.mode_rule), scenario, share)
