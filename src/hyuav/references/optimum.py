"""The best possible flight under each mode rule, by dynamic programming over the helper's position.

Given the position, fading and tasks are independent from slot to slot and unknown when the
action is taken. The best expected return is therefore a deterministic dynamic program over the
position alone,

    V_t(x) = max over x' within reach of x of [ E r(x, x') + V_{t+1}(x') ],

with the reward r = C of the mode that is taken, max(C_1, C_0) for the hybrid helper, C_1 for relay
only and C_0 for jamming only; or with another reward of the slot, in the same modes. Most rewards
depend on x' alone, where the slot is spent; one may depend on the velocity too. Positions are taken
from a grid, which makes V a lower bound to the continuous optimum.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import torch
import torch.nn.functional as F  # noqa: N812
from pydantic import Field
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.parameters import LARGEST_COUNT, OneOrMore, checked
from hyuav.envs.arguments import as_scenario, as_seed
from hyuav.envs.reward import EPISODE, VELOCITY, Reward, Source
from hyuav.envs.rewards import DEFAULT, SUM_RATE, as_reward
from hyuav.physics.offloading import MODE_RULES, ModeRuleName
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.grid import Grid, Reach, best_flight, grid_over_map, values_to_go
from hyuav.references.rewards import estimate_return, reward_maps

RESOLUTION = 1.0
"""Default grid spacing in metres: halving it moves no preset's value by 0.2 %."""

COARSE_RESOLUTION = 2.0
"""The same where a reward depends on the velocity, of which there are hundreds then."""

DRAWS, FEW_DRAWS = 256, 64
"""By default, of a slot's fading and tasks; fewer where a reward depends on the velocity."""

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
    """Expected undiscounted return of the flight in the unit of the reward, from draws that did not
    choose it."""
    standard_error: float
    """Of ``value``; 0 where no slot is random."""
    path: Tensor
    """(T + 1, H, 2) m, float64: where the helpers are before the first slot and in each slot."""
    modes: Tensor
    """(T, H) int64: 1 relay, 0 jamming. Of the hybrid, relay where expected C_1 exceeds C_0."""
    power: Tensor
    """(T, H) W, float64: the nominal power of the mode."""
    upper_bound: float | None = None
    """Of what any flight earns; None where none is computed."""


class FlightPolicy(TensorDictModuleBase):
    """Fly a given path in an environment made by :func:`hyuav.make_env`.

    Reads ``position`` (..., H, 2) m and ``step_count`` (..., 1), writes ``action`` (..., 2 H): the
    velocities, in units of v_max, that lead to the path's next positions. The helpers stay at the
    last ones when the path is flown.

    Args:
        path: (T + 1, H, 2) m, such as :attr:`Optimum.path`.
        scenario: whose speed and slot duration the environment has.

    Example:
        >>> optimum = solve_optimum("two_clusters", ["hybrid"])["hybrid"]
        >>> env = make_env(optimum.scenario, "hybrid", batch_size=(100,))
        >>> env.rollout(20, FlightPolicy(optimum.path, optimum.scenario))
    """

    in_keys = ("position", "step_count")
    out_keys = ("action",)

    def __init__(self, path: Tensor, scenario: Scenario) -> None:
        super().__init__()
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
    resolution: float | None = None,
    draws: int | None = None,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
    reward: Reward | Source | str = SUM_RATE,
) -> dict[str, Optimum]:
    """The best flight under each mode rule over the scenario's T slots.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        mode_rules: who may choose the modes, of :data:`hyuav.physics.offloading.MODE_RULES`.
        resolution: spacing of the grid in m; the helper's start is a grid point. None for
            :data:`RESOLUTION`, or :data:`COARSE_RESOLUTION` where the reward depends on the
            velocity.
        draws: of a slot's fading and tasks that the expected reward is averaged over, the same
            at all positions. They choose the flight and nothing else. None for :data:`DRAWS`, or
            :data:`FEW_DRAWS`.
        evaluation_draws: of whole episodes, from which the flight's value is estimated.
        seed: of all draws; not used where no slot is random.
        track: passes on the mode rules one by one, as what shows the progress does.
        reward: what a slot earns, as for :func:`hyuav.make_env`; the mode is chosen by the secrecy
            sum-rate whatever it is. There is no optimum of one that does not add up over slots.

    Returns:
        an :class:`Optimum` for each mode rule.

    Raises:
        InputError: (a ``ValueError``) an unknown preset or mode rule, a resolution that is not
            above 0 or needs more than :data:`MEMORY_LIMIT`, fewer than two draws, a reward of which
            there is no optimum.
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
        reward=reward,
    )
    return {mode_rule: optima[scenario.num_slots] for mode_rule, optima in found.items()}


def solve_horizons(
    scenario: Scenario | str,
    horizons: Sequence[int],
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float | None = None,
    draws: int | None = None,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
    reward: Reward | Source | str = SUM_RATE,
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
        reward: what a slot earns.

    Returns:
        by mode rule and horizon.

    Raises:
        InputError: as :func:`solve_optimum`, and for horizons that are none or below 1.
    """
    scenario = as_scenario(scenario)
    mode_rules = checked(OneOrMore[ModeRuleName], "mode_rules", mode_rules)
    scenarios = _with_horizons(scenario, horizons)
    longest = max(scenarios)
    reward = as_reward(reward)
    if (reason := why_no_optimum(reward, scenario)) is not None:
        raise InputError(rejection("reward", reward.name, f"one that has an optimum ({reason})"))
    by_flight = depends_on_velocity(reward, scenario)
    draws = checked(_Draws, "draws", draws or (FEW_DRAWS if by_flight else DRAWS))
    evaluation_draws = checked(_Draws, "evaluation_draws", evaluation_draws)
    resolution = usable_resolution(resolution, scenario, longest, reward)
    root = torch.Generator().manual_seed(as_seed(seed))
    map_seed, evaluation_seed = torch.randint(2**62, (2,), generator=root).tolist()

    physics = Physics(scenario, dtype=torch.float64)
    grid = grid_over_map(scenario, resolution)

    def expected(rules: Sequence[str], velocities: Tensor | None = None) -> Tensor:
        drawn = torch.Generator().manual_seed(map_seed)
        maps = reward_maps(physics, grid.positions(), draws, drawn, reward, velocities, rules)
        if not maps.isfinite().all():
            kind = "all over the map" + ("" if by_flight else ", whatever the velocity")
            raise InputError(rejection("reward", reward.name, f"finite numbers {kind}"))
        return maps.reshape(*maps.shape[:-1], *grid.shape)

    maps = None if by_flight else dict(zip(MODE_RULES, expected(MODE_RULES), strict=True))
    optima: dict[str, dict[int, Optimum]] = {}
    for mode_rule in track(mode_rules):
        reach = _reach(physics, mode_rule, grid, resolution)
        moves = torch.from_numpy(reach.displacements) * (resolution / scenario.slot_duration)
        own = (expected([mode_rule], moves)[0] if maps is None else maps[mode_rule]).numpy()
        values = values_to_go(own, reach, longest)
        optima[mode_rule] = {}
        for horizon, shorter in scenarios.items():
            path = _flyable(best_flight(own, values, reach, grid, horizon), physics, mode_rule)
            # The same episodes for every flight, so that differences between them stand out.
            generator = torch.Generator().manual_seed(evaluation_seed)
            value, error, modes = estimate_return(
                physics, path, mode_rule, evaluation_draws, generator, reward
            )
            optima[mode_rule][horizon] = Optimum(
                shorter, mode_rule, resolution, value, error, path, modes, _power(scenario, modes)
            )
    return optima


def depends_on_velocity(reward: Reward, scenario: Scenario) -> bool:
    """Whether a slot earns what depends on how the helper flew."""
    return reward != DEFAULT and reward.dependence(scenario) == VELOCITY


def why_no_optimum(reward: Reward, scenario: Scenario) -> str | None:
    """One sentence on why there is no optimum of a reward; None where there is one.

    Args:
        reward: what a slot earns.
        scenario: in which a function is tried.
    """
    if reward.is_transform:
        return "no optimum: a transform need not add up over slots"
    if reward != DEFAULT and reward.dependence(scenario) == EPISODE:
        return "no optimum: it does not add up over slots"
    return None


def usable_resolution(
    resolution: float | None, scenario: Scenario, num_slots: int, reward: Reward = DEFAULT
) -> float:
    """A grid spacing in m, the default where it is None, whose tables fit :data:`MEMORY_LIMIT`.

    Raises:
        InputError: it is not above 0, or too fine.
        InputTypeError: it is not a number.
    """
    by_flight = depends_on_velocity(reward, scenario)
    if resolution is None:
        resolution = COARSE_RESOLUTION if by_flight else RESOLUTION
    require_resolution(resolution, scenario.map_side, num_slots)
    reached = 2 * scenario.max_speed * scenario.slot_duration / resolution + 1
    points = scenario.map_side / resolution + 1
    if by_flight and 8 * 3 * (reached * points) ** 2 > MEMORY_LIMIT:
        accepted = "a number of metres for which each displacement has a table (within 4 GiB)"
        raise InputError(rejection("resolution", resolution, accepted))
    return resolution


def _with_horizons(scenario: Scenario, horizons: Sequence[int]) -> dict[int, Scenario]:
    if not isinstance(horizons, Sequence | range) or not horizons:
        raise InputError(rejection("horizons", horizons, "at least one whole number >= 1"))
    return {n: dataclasses.replace(scenario, num_slots=n) for n in horizons}


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
    powers = torch.tensor([scenario.jamming_power, scenario.relay_power], dtype=torch.float64)
    return powers[modes]
