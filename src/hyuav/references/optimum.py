"""The best possible flight under each mode rule, by dynamic programming over the helper's position.

Given the position, fading and tasks are independent from slot to slot and unknown when the
action is taken. The best expected return is therefore a deterministic dynamic program over the
position alone,

    V_t(x) = max over x' within reach of x of [ E r(x') + V_{t+1}(x') ],

with the reward r = max(C_1, C_0) for the hybrid helper, C_1 for relay only and C_0 for jamming
only. Positions are taken from a grid, which makes V a lower bound to the continuous optimum.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from numpy.typing import ArrayLike
from pydantic import Field
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.parameters import LARGEST_COUNT, OneOrMore, checked, plain
from hyuav.envs.arguments import as_seed
from hyuav.physics.offloading import MODE_RULES, ModeRuleName
from hyuav.physics.scenario import Scenario, as_scenario
from hyuav.physics.slot import Physics
from hyuav.references.grid import Grid, Reach, best_flight, grid_over_map, values_to_go
from hyuav.references.rewards import estimate_return, reward_maps

RESOLUTION = 1.0
"""Default grid spacing in metres: halving it moves no preset's value by 0.2 %."""

MEMORY_LIMIT = 4 * 2**30
"""Bytes that the value tables may take."""


_Draws = Annotated[int, Field(ge=2, le=LARGEST_COUNT)]


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best flight under one mode rule over one horizon."""

    scenario: Scenario
    """What is flown; its ``num_slots`` is the horizon T of this flight."""
    mode_rule: str
    """Who chooses the helper's mode."""
    resolution: float
    """Spacing of the grid in metres."""
    value: float
    """Expected undiscounted return of the flight in bps/Hz, from draws that did not choose it."""
    standard_error: float
    """Of ``value`` in bps/Hz; 0 where no slot is random."""
    path: Tensor
    """(T + 1, H, 2) m, float64: where the helpers are before the first slot and in each slot."""
    modes: Tensor
    """(T, H) int64: 1 relay, 0 jamming. Of the hybrid, relay where expected C_1 exceeds C_0."""
    power: Tensor
    """(T, H) W, float64: the nominal power of the mode."""
    upper_bound: float | None = None
    """Of what any flight earns, in bps/Hz; None where none is computed."""


class FlightPolicy(TensorDictModuleBase):
    """Fly a given path in an environment made by :func:`hyuav.make_env`.

    Reads ``position`` (..., H, 2) m and ``step_count`` (..., 1), writes ``action`` (..., 2 H): the
    velocities, in units of v_max, that lead to the path's next positions. The helpers stay at the
    last ones when the path is flown.

    Args:
        path: (T + 1, H, 2) m, such as :attr:`Optimum.path`; a tensor, an array or lists.
        scenario: whose speed and slot duration the environment has, or the name of a preset.

    Raises:
        InputError: a path of another shape.
        InputTypeError: an argument of the wrong type.

    Example:
        >>> optimum = solve_optimum("two_clusters", ["hybrid"])["hybrid"]
        >>> env = make_env(optimum.scenario, "hybrid", batch_size=(100,))
        >>> env.rollout(20, FlightPolicy(optimum.path, optimum.scenario))
    """

    in_keys = ("position", "step_count")
    out_keys = ("action",)

    def __init__(self, path: Tensor | ArrayLike, scenario: Scenario | str) -> None:
        super().__init__()
        scenario, given = as_scenario(scenario), path
        accepted = f"positions in m of shape (T + 1, {scenario.num_helpers}, 2)"
        try:
            path = path if isinstance(path, Tensor) else torch.from_numpy(np.array(path, float))
        except (TypeError, ValueError):
            raise InputTypeError(rejection("path", given, accepted)) from None
        if path.ndim != 3 or path.shape[1:] != (scenario.num_helpers, 2) or not len(path):
            raise InputError(rejection("path", tuple(path.shape), accepted))
        self.register_buffer("path", path.to(torch.float64))
        self.step_length = scenario.max_speed * scenario.slot_duration

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the action of each helper in the batch."""
        path = self.get_buffer("path")
        slot = (tensordict["step_count"].squeeze(-1) + 1).clamp(max=len(path) - 1)
        position = tensordict["position"]
        action = ((path[slot] - position) / self.step_length).flatten(-2)
        return tensordict.set("action", action.clamp(-1.0, 1.0).to(position.dtype))


def solve_optimum(
    scenario: Scenario | str,
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float = RESOLUTION,
    draws: int = 256,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
) -> dict[str, Optimum]:
    """The best flight under each mode rule over the scenario's T slots.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        mode_rules: who may choose the modes, of :data:`hyuav.physics.offloading.MODE_RULES`.
        resolution: spacing of the grid in m; the helper's start is a grid point.
        draws: of a slot's fading and tasks that the expected reward is averaged over, the same
            at all positions. They choose the flight and nothing else.
        evaluation_draws: of whole episodes, from which the flight's value is estimated.
        seed: of all draws; not used where no slot is random.
        track: passes on the mode rules one by one, as what shows the progress does.

    Returns:
        an :class:`Optimum` for each mode rule.

    Raises:
        InputError: (a ``ValueError``) an unknown preset or mode rule, a resolution that is not
            above 0 or needs more than :data:`MEMORY_LIMIT`, fewer than two draws.
        InputTypeError: (also a ``TypeError``) an argument of the wrong type.
    """
    scenario = as_scenario(scenario)
    found = solve_horizons(
        scenario,
        (scenario.num_slots,),
        mode_rules,
        resolution=resolution,
        draws=draws,
        evaluation_draws=evaluation_draws,
        seed=seed,
        track=track,
    )
    return {mode_rule: optima[scenario.num_slots] for mode_rule, optima in found.items()}


def solve_horizons(
    scenario: Scenario | str,
    horizons: Sequence[int],
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float = RESOLUTION,
    draws: int = 256,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
) -> dict[str, dict[int, Optimum]]:
    """The best flight under each mode rule over each horizon, from one backward pass.

    Args:
        scenario: as for :func:`solve_optimum`, like all that follows ``horizons``; its
            ``num_slots`` is not used.
        horizons: numbers of slots T, each at least 1.
        mode_rules: who may choose the modes.
        resolution: spacing of the grid in m.
        draws: that the expected reward is averaged over.
        evaluation_draws: from which each flight's value is estimated.
        seed: of all draws.
        track: passes on the mode rules.

    Returns:
        by mode rule and horizon.

    Raises:
        InputError: as :func:`solve_optimum`, and for horizons that are none or below 1.
    """
    scenario = as_scenario(scenario)
    mode_rules = checked(OneOrMore[ModeRuleName], "mode_rules", mode_rules)
    scenarios = _with_horizons(scenario, horizons)
    longest = max(scenarios)
    draws = checked(_Draws, "draws", draws)
    evaluation_draws = checked(_Draws, "evaluation_draws", evaluation_draws)
    resolution = plain(resolution)
    require_resolution(resolution, scenario.map_side, longest)
    root = torch.Generator().manual_seed(as_seed(seed))
    map_seed, evaluation_seed = torch.randint(2**62, (2,), generator=root, device="cpu").tolist()

    physics = Physics(scenario, dtype=torch.float64)
    grid = grid_over_map(scenario, resolution)
    maps = reward_maps(physics, grid.positions(), draws, torch.Generator().manual_seed(map_seed))
    optima: dict[str, dict[int, Optimum]] = {}
    for mode_rule in track(mode_rules):
        reward = maps[MODE_RULES.index(mode_rule)].reshape(grid.shape).numpy()
        reach = _reach(physics, mode_rule, grid, resolution)
        values = values_to_go(reward, reach, longest)
        optima[mode_rule] = {}
        for horizon, shorter in scenarios.items():
            path = _flyable(best_flight(reward, values, reach, grid, horizon), physics, mode_rule)
            # The same episodes for every flight, so that differences between them stand out.
            generator = torch.Generator().manual_seed(evaluation_seed)
            value, error, modes = estimate_return(
                physics, path, mode_rule, evaluation_draws, generator
            )
            optima[mode_rule][horizon] = Optimum(
                shorter, mode_rule, resolution, value, error, path, modes, _power(scenario, modes)
            )
    return optima


def _with_horizons(scenario: Scenario, horizons: Sequence[int]) -> dict[int, Scenario]:
    numbers = plain(horizons)
    if not isinstance(numbers, tuple) or not numbers:
        raise InputError(rejection("horizons", horizons, "at least one whole number >= 1"))
    return {n: dataclasses.replace(scenario, num_slots=n) for n in numbers}


def require_resolution(resolution: float, map_side: float, num_slots: int) -> None:
    """Accept a grid spacing in m for which the tables of a horizon fit :data:`MEMORY_LIMIT`.

    Raises:
        InputError: it is not above 0, or too fine.
        InputTypeError: it is not a number.
    """
    if isinstance(resolution, bool) or not isinstance(resolution, int | float):
        raise InputTypeError(rejection("resolution", resolution, "a number of metres > 0"))
    # One table per slot, and about ten more for positions, rewards and intermediate results.
    points_per_side = math.sqrt(MEMORY_LIMIT / (8 * (num_slots + 10))) - 1
    finest = map_side / max(points_per_side, 1.0)
    if not finest <= resolution < math.inf:
        reason = f"a number of metres >= {finest:.3g} (finer grids need over 4 GiB)"
        raise InputError(rejection("resolution", resolution, reason))


def _reach(physics: Physics, mode_rule: str, grid: Grid, resolution: float) -> Reach:
    scenario = physics.scenario
    spacings = scenario.slot_duration / resolution
    norm_limit = physics.norm_limit([mode_rule])
    disc = math.inf if norm_limit is None else float(norm_limit) * spacings
    return Reach(min(scenario.max_speed * spacings, max(grid.shape)), disc)


def _flyable(path: Tensor, physics: Physics, mode_rule: str) -> Tensor:
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


def _power(scenario: Scenario, modes: Tensor) -> Tensor:
    powers = scenario.jamming_power, scenario.relay_power
    return torch.tensor(powers, dtype=torch.float64, device=modes.device)[modes]
