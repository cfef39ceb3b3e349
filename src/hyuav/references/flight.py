"""A path as it is flown: in an environment, and where float32 rounds."""

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from numpy.typing import ArrayLike
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav.physics.scenario import Scenario, ScenarioLike, as_scenario
from hyuav.physics.slot import Physics


class FlightPolicy(TensorDictModuleBase):
    """Fly a given path in an environment made by :func:`hyuav.make_env`.

    Reads ``position`` (..., H, 2) m and ``step_count`` (..., 1), writes ``action`` (..., 2 H): the
    velocities, in units of v_max, that lead to the path's next positions; with power control
    (..., 3 H), each followed by the power. The helpers stay at the last places when the path is
    flown.

    Args:
        path: (T + 1, H, 2) m, such as :attr:`Optimum.path`; a tensor, an array or lists.
        scenario: whose speed, slot duration and power range the environment has, or the name of a
            preset.
        power: (T, H), in units of the nominal power, such as :attr:`Optimum.share`; None for that.
        upper_bound: of what any flight earns, such as :attr:`Optimum.upper_bound`, to be told
            beside what this one does; None where it is not known.

    Raises:
        InputError: a path of another shape.
        InputTypeError: an argument of the wrong type.

    Example:
        >>> there_and_back = [[-60, -60]], [[-45, -60]], [[-60, -60]]
        >>> policy = FlightPolicy(there_and_back, "two_clusters")
        >>> optimum = solve_optimum("two_clusters", ["hybrid"])["hybrid"]
        >>> env = make_env(optimum.scenario, "hybrid", batch_size=(100,))
        >>> flights = env.rollout(20, optimum.policy)
    """

    in_keys = ("position", "step_count")
    out_keys = ("action",)

    def __init__(
        self,
        path: Tensor | ArrayLike,
        scenario: ScenarioLike,
        power: Tensor | None = None,
        upper_bound: float | None = None,
    ) -> None:
        super().__init__()
        self.upper_bound = upper_bound
        scenario, given = as_scenario(scenario), path
        accepted = f"positions in m of shape (T + 1, {scenario.num_helpers}, 2)"
        try:
            path = path if isinstance(path, Tensor) else torch.from_numpy(np.array(path, float))
        except (TypeError, ValueError):
            raise InputTypeError(rejection("path", given, accepted)) from None
        if path.ndim != 3 or path.shape[1:] != (scenario.num_helpers, 2) or not len(path):
            raise InputError(rejection("path", tuple(path.shape), accepted))
        self.register_buffer("path", path.to(torch.float64))
        nominal = torch.ones(max(len(path) - 1, 1), scenario.num_helpers)
        share = nominal if power is None else power
        self.register_buffer("power", share.to(torch.float64))
        self.scenario = scenario

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the actions of each flight in the batch."""
        path = self.get_buffer("path")
        slot = (tensordict["step_count"].squeeze(-1) + 1).clamp(max=len(path) - 1)
        position, power = tensordict["position"], self.get_buffer("power")
        action = towards(self.scenario, position, path[slot], power[slot - 1])
        return tensordict.set("action", action.flatten(-2).to(position.dtype))


def towards(scenario: Scenario, position: Tensor, target: Tensor, power: Tensor) -> Tensor:
    """The actions (..., H, 2) that lead helpers to places, or (..., H, 3) that tell powers too.

    Args:
        scenario: whether its power is controlled, how far down, and how far a slot's flight leads.
        position: (..., H, 2) m, where they are.
        target: (..., H, 2) m, where they are to be after the slot.
        power: (..., H), in units of the nominal power.
    """
    action = (target - position) / (scenario.max_speed * scenario.slot_duration)
    if scenario.power_control:
        decibels = 10.0 * power.log10()
        told = (1.0 + 2.0 * decibels / scenario.power_range).unsqueeze(-1)
        action = torch.cat([action, told], dim=-1)
    return action.clamp(-1.0, 1.0)


def flyable(path: Tensor, physics: Physics, mode_rule: str) -> Tensor:
    """Draw a path (T + 1, H, 2) m back from the edges that float32 would put it beyond.

    The best positions often lie exactly on the edge of a UE's coverage or of the map, and an
    environment in float32 may miss the edge by a few units in the last place: the reward of a
    slot would be lost. Such positions are moved by some 0.1 mm (on a map of 200 m), towards the
    UEs on whose edge of coverage they lie and towards the inside of the map.
    """
    scenario = physics.scenario
    shift = 4 * torch.finfo(torch.float32).eps * scenario.map_side
    to_ues = physics.nodes.ue - path.unsqueeze(-2)
    distance = torch.linalg.vector_norm(to_ues, dim=-1)
    on_edge = (distance - scenario.coverage_radius).abs() < shift / 2
    inwards = (F.normalize(to_ues, dim=-1) * on_edge.unsqueeze(-1)).sum(dim=-2)
    inside = scenario.map_side / 2 - shift
    targets = (path + shift * F.normalize(inwards, dim=-1)).clamp(-inside, inside)
    # A shifted position may lie just out of reach of the one before: fly there as the helper can.
    norm_limit = physics.norm_limit([mode_rule])
    norm_limit = None if norm_limit is None else norm_limit[0]
    step_length = scenario.max_speed * scenario.slot_duration
    flown = [path[0]]
    for target in targets[1:]:
        action = (target - flown[-1]) / step_length
        velocity = physics.velocity(action, norm_limit)
        flown.append(physics.move(flown[-1], velocity).position)
    return torch.stack(flown)
