"""The reference schemes that fly a straight line: Re-LT and Ja-LT."""

import math

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from hyuav._support.errors import InputError
from hyuav.physics.energy import budget_speed
from hyuav.physics.scenario import Point, Scenario, as_scenario


def relay_destination(scenario: Scenario) -> Point:
    """Where Re-LT arrives: midway between L and the centroid of the UEs, in m."""
    xs, ys = zip(*scenario.ue_positions, strict=True)
    x, y = scenario.legitimate_position
    return (x + sum(xs) / scenario.num_ues) / 2, (y + sum(ys) / scenario.num_ues) / 2


def jamming_destination(scenario: Scenario) -> Point:
    """Where Ja-LT arrives: the eavesdropper UAV's position, in m."""
    return scenario.eavesdropper_positions[0]


class ConstantVelocity(TensorDictModuleBase):
    """Fly straight and at constant speed from the helper's start to a point, reached in slot T.

    Writes ``action`` (..., 2) beside the ``position`` (..., 1, 2) that it reads.

    Args:
        scenario: its start, horizon and speed limit.
        destination: (x, y) in m.
        mode_rule: "relay" or "jamming", whose transmission energy counts against E_H.

    Raises:
        InputError: the flight would need more than v_max, or more energy than E_H in a slot.
    """

    in_keys = ("position",)
    out_keys = ("action",)

    def __init__(self, scenario: Scenario, destination: Point, mode_rule: str) -> None:
        super().__init__()
        duration = scenario.num_slots * scenario.slot_duration
        velocity = [
            (end - start) / duration
            for start, end in zip(scenario.helper_starts[0], destination, strict=True)
        ]
        fastest = max(abs(component) for component in velocity)
        if scenario.speed_limit == "disc":
            fastest = math.hypot(*velocity)
        affordable = budget_speed(scenario, mode_rule)
        self._require_speed(scenario, destination, fastest, scenario.max_speed, "max_speed")
        self._require_speed(
            scenario, destination, math.hypot(*velocity), affordable, "helper_energy_budget"
        )
        action = [component / scenario.max_speed for component in velocity]
        self.register_buffer("action", torch.tensor(action, dtype=torch.float32, device="cpu"))

    @staticmethod
    def _require_speed(
        scenario: Scenario, destination: Point, needed: float, limit: float, name: str
    ) -> None:
        if needed > limit * (1 + 1e-6):
            start, end = (f"({x:g}, {y:g})" for x, y in (scenario.helper_starts[0], destination))
            raise InputError(
                f"num_slots = {scenario.num_slots}: a straight flight from {start} to {end} "
                f"needs {needed:.4g} m/s, and {name} allows {limit:.4g} m/s"
            )

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the same action for every helper."""
        tensordict["action"] = self.action.expand_as(tensordict["position"].flatten(-2))
        return tensordict


def re_lt(scenario: Scenario | str) -> ConstantVelocity:
    """Relay mode with a linear trajectory (Re-LT), in a scenario or a preset of that name."""
    scenario = as_scenario(scenario)
    return ConstantVelocity(scenario, relay_destination(scenario), "relay")


def ja_lt(scenario: Scenario | str) -> ConstantVelocity:
    """Jamming mode with a linear trajectory (Ja-LT), in a scenario or a preset of that name."""
    scenario = as_scenario(scenario)
    return ConstantVelocity(scenario, jamming_destination(scenario), "jamming")
