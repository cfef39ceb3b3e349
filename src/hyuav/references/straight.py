"""The references that fly straight lines, Re-LT and Ja-LT, and the one that does not fly."""

import math
from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from hyuav._support.errors import InputError
from hyuav.physics.energy import budget_speeds
from hyuav.physics.scenario import Point, Scenario, ScenarioLike, as_scenario


def relay_destination(scenario: Scenario) -> Point:
    """Where all helpers of Re-LT arrive: midway between L and the centroid of the UEs, in m."""
    xs, ys = zip(*scenario.ue_positions, strict=True)
    x, y = scenario.legitimate_position
    return (x + sum(xs) / scenario.num_ues) / 2, (y + sum(ys) / scenario.num_ues) / 2


def jamming_destinations(scenario: Scenario) -> list[Point]:
    """Where Ja-LT arrives: helper i at eavesdropper i mod E, in m."""
    eavesdroppers = scenario.eavesdropper_positions
    return [eavesdroppers[i % len(eavesdroppers)] for i in range(scenario.num_helpers)]


class ConstantVelocity(TensorDictModuleBase):
    """Fly straight and at constant speed from the helpers' starts to points, reached in slot T.

    Writes ``action`` (..., 2 H) beside the ``position`` (..., H, 2) that it reads; with power
    control (..., 3 H), always at the nominal power.

    Args:
        scenario: its starts, horizon and speed limit.
        destinations: (x, y) in m, one for each helper.
        mode_rule: "relay" or "jamming", whose transmission energy counts against E_H.

    Raises:
        InputError: a flight would need more than v_max, or more energy than E_H in a slot.
    """

    in_keys = ("position",)
    out_keys = ("action",)

    def __init__(self, scenario: Scenario, destinations: Sequence[Point], mode_rule: str) -> None:
        super().__init__()
        duration = scenario.num_slots * scenario.slot_duration
        affordable = budget_speeds(scenario, mode_rule)
        action: list[float] = []
        flights = zip(scenario.helper_starts, destinations, affordable, strict=True)
        for start, end, speed in flights:
            velocity = [(to - begin) / duration for begin, to in zip(start, end, strict=True)]
            norm = math.hypot(*velocity)
            disc = scenario.speed_limit == "disc"
            fastest = norm if disc else max(abs(component) for component in velocity)
            for needed, limit, name in (
                (fastest, scenario.max_speed, "max_speed"),
                (norm, speed, "helper_energy_budget"),
            ):
                if needed > limit * (1 + 1e-6):
                    points = " to ".join(f"({x:g}, {y:g})" for x, y in (start, end))
                    raise InputError(
                        f"num_slots = {scenario.num_slots}: a straight flight from {points} "
                        f"needs {needed:.4g} m/s, and {name} allows {limit:.4g} m/s"
                    )
            nominal_power = [1.0] * (scenario.action_size - 2)
            action += [component / scenario.max_speed for component in velocity] + nominal_power
        self.register_buffer("action", torch.tensor(action, dtype=torch.float32, device="cpu"))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the same action for every flight of the batch."""
        action = self.get_buffer("action")
        tensordict["action"] = action.expand(*tensordict["position"].shape[:-2], -1)
        return tensordict


def re_lt(scenario: ScenarioLike) -> ConstantVelocity:
    """Relay mode with a linear trajectory (Re-LT), in a scenario or a preset of that name."""
    scenario = as_scenario(scenario)
    destination = relay_destination(scenario)
    return ConstantVelocity(scenario, [destination] * scenario.num_helpers, "relay")


def ja_lt(scenario: ScenarioLike) -> ConstantVelocity:
    """Jamming mode with a linear trajectory (Ja-LT), in a scenario or a preset of that name."""
    scenario = as_scenario(scenario)
    return ConstantVelocity(scenario, jamming_destinations(scenario), "jamming")


def no_helper(scenario: ScenarioLike) -> ConstantVelocity:
    """Nobody helps: the helpers stay where they start.

    To be flown in jamming mode with ``jamming_power=0``, as the scheme ``no_helper`` of
    :func:`hyuav.evaluate` is: then every covered UE may send straight to L for its whole share of
    the slot, and nobody relays or jams.
    """
    scenario = as_scenario(scenario)
    return ConstantVelocity(scenario, scenario.helper_starts, "jamming")
