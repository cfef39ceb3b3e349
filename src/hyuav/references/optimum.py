"""The best possible flight under each mode rule, by dynamic programming over the helper's position.

Given the position, fading and tasks are independent from slot to slot and unknown when the
action is taken. The best expected return of one helper is therefore a deterministic dynamic
program over the position alone,

    V_t(x) = max over x' within reach of x of [ E r(x') + V_{t+1}(x') ],

with the reward r = max(C_1, C_0) for the hybrid helper, C_1 for relay only and C_0 for jamming
only; where the power is controlled, with the best power at x'. Positions are taken from a grid,
which makes V a lower bound to the continuous optimum. For several helpers see
:mod:`hyuav.references.joint`, and for what no flight exceeds :mod:`hyuav.references.bounds`.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.parameters import LARGEST_COUNT, OneOrMore, checked, plain
from hyuav.envs.arguments import as_seed
from hyuav.envs.reward import Reward, Source
from hyuav.envs.rewards import DEFAULT, SUM_RATE, as_reward
from hyuav.physics.modes import MODE_RULES, fixed_modes
from hyuav.physics.scenario import Scenario, ScenarioLike, as_scenario
from hyuav.physics.slot import Physics
from hyuav.references.bounds import CellBounds
from hyuav.references.flight import FlightPolicy, flyable
from hyuav.references.grid import (
    Values,
    best_flight,
    grid_over_map,
    reaches_of,
    values_to_go,
)
from hyuav.references.joint import SeveralHelpers
from hyuav.references.objectives import (
    depends_on_velocity,
    estimate_objective,
    reward_maps,
    why_no_optimum,
)
from hyuav.references.power import ROUGH_DRAWS, best_levels
from hyuav.references.rewards import ExpectedReward, estimate_return

RESOLUTION = 1.0
"""Default grid spacing in metres: halving it moves no preset's value by 0.2 %."""

COARSE_RESOLUTION = 2.0
"""The same where a reward depends on the velocity, of which there are hundreds then."""

DRAWS, FEW_DRAWS = 256, 64
"""By default, of a slot's fading and tasks; fewer where a reward depends on the velocity."""

MEMORY_LIMIT = 4 * 2**30
"""Bytes that the value tables may take."""


_Draws = Annotated[int, Field(ge=2, le=LARGEST_COUNT)]
_ModeRule = Annotated[
    str, Field(description=f"{', '.join(MODE_RULES)}, or a letter r or j for each helper")
]
PowerStep = Annotated[float, Field(ge=0.01, le=120.0)]


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
    """(T, H) W, float64: what the helpers send at in these modes."""
    share: Tensor
    """(T, H): the same in units of the nominal power."""
    upper_bound: float | None = None
    """Of what any flight earns; None where none is computed."""

    @property
    def policy(self) -> FlightPolicy:
        """What flies it in environments of this scenario."""
        return FlightPolicy(self.path, self.scenario, self.share, self.upper_bound)


def solve_optimum(
    scenario: ScenarioLike,
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float | None = None,
    power_step: float = 1.0,
    draws: int | None = None,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    certify: bool | None = None,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
    reward: Reward | Source | str = SUM_RATE,
) -> dict[str, Optimum]:
    """The best flight under each mode rule over the scenario's T slots.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        mode_rules: who may choose the modes: of :data:`hyuav.physics.modes.MODE_RULES`, or a
            letter r or j for each helper.
        resolution: spacing of the grid in m; the helpers' starts are grid points. None for
            :data:`RESOLUTION`, or :data:`COARSE_RESOLUTION` where the reward depends on the
            velocity.
        power_step: between the levels of power that are tried, in dB, where it is controlled.
        draws: of a slot's fading and tasks that the expected reward is averaged over, the same
            at all positions. They choose the flight and nothing else. None for :data:`DRAWS`, or
            :data:`FEW_DRAWS`.
        evaluation_draws: of whole episodes, from which the flight's value is estimated.
        seed: of all draws; not used where no slot is random.
        certify: give the upper bound too, which takes some seconds; None for several helpers only.
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
        power_step=power_step,
        draws=draws,
        evaluation_draws=evaluation_draws,
        seed=seed,
        certify=certify,
        track=track,
        reward=reward,
    )
    return {mode_rule: optima[scenario.num_slots] for mode_rule, optima in found.items()}


def solve_horizons(
    scenario: ScenarioLike,
    horizons: Sequence[int],
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float | None = None,
    power_step: float = 1.0,
    draws: int | None = None,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    certify: bool | None = None,
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
        power_step: between the levels of power in dB.
        draws: that the expected reward is averaged over.
        evaluation_draws: from which each flight's value is estimated.
        seed: of all draws.
        certify: give upper bounds too; None for several helpers only.
        track: passes on the mode rules.
        reward: what a slot earns.

    Returns:
        by mode rule and horizon.

    Raises:
        InputError: as :func:`solve_optimum`, and for horizons that are none or below 1.
    """
    scenario = as_scenario(scenario)
    mode_rules = checked(OneOrMore[_ModeRule], "mode_rules", mode_rules)
    for mode_rule in mode_rules:
        fixed_modes(mode_rule, scenario.num_helpers, "mode_rules")
    checked(PowerStep, "power_step", power_step)
    scenarios = _with_horizons(scenario, horizons)
    longest = max(scenarios)
    reward = as_reward(reward)
    if (reason := why_no_optimum(reward, scenario)) is not None:
        raise InputError(rejection("reward", reward.name, f"one that has an optimum ({reason})"))
    few = depends_on_velocity(reward, scenario)
    draws = checked(_Draws, "draws", draws or (FEW_DRAWS if few else DRAWS))
    evaluation_draws = checked(_Draws, "evaluation_draws", evaluation_draws)
    resolution = usable_resolution(plain(resolution), scenario, longest, reward)
    root = torch.Generator().manual_seed(as_seed(seed))
    map_seed, evaluation_seed = torch.randint(2**62, (2,), generator=root, device="cpu").tolist()

    physics, one = Physics(scenario, dtype=torch.float64), scenario.num_helpers == 1
    planner: _OneHelper | SeveralHelpers
    if one:
        planner = _OneHelper(physics, mode_rules, longest, resolution)
        if reward == DEFAULT:
            planner.earn_sum_rate(power_step, draws, map_seed)
        else:
            planner.earn(reward, draws, map_seed)
    else:
        planner = SeveralHelpers(physics, resolution, power_step, draws, map_seed)
    bounds = None
    if reward == DEFAULT and (not one if certify is None else certify):
        bounds = CellBounds(physics, map_seed)
    optima: dict[str, dict[int, Optimum]] = {}
    for mode_rule in track(mode_rules):
        optima[mode_rule] = {}
        for horizon, shorter in scenarios.items():
            path, share = planner.best(mode_rule, horizon)
            path = flyable(path, physics, mode_rule)
            # The same episodes for every flight, so that differences between them stand out.
            generator = torch.Generator().manual_seed(evaluation_seed)
            value, error, modes = estimate_return(
                physics, path, mode_rule, evaluation_draws, generator, share
            )
            if reward != DEFAULT:
                generator.manual_seed(evaluation_seed)
                value, error = estimate_objective(
                    physics, path, mode_rule, evaluation_draws, generator, reward
                )
            optima[mode_rule][horizon] = Optimum(
                shorter,
                mode_rule,
                resolution,
                value,
                error,
                path,
                modes,
                _nominal(scenario, modes) * share,
                share,
                None if bounds is None else bounds.of(mode_rule, horizon, value),
            )
    return optima


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


class _OneHelper:
    """The best flights of one helper on a grid, under every mode rule and over every horizon.

    Args:
        physics: in float64.
        mode_rules: that are asked for.
        num_slots: the longest horizon.
        resolution: spacing of the grid in m.
    """

    def __init__(
        self, physics: Physics, mode_rules: Sequence[str], num_slots: int, resolution: float
    ) -> None:
        self._physics, self._rules, self._num_slots = physics, mode_rules, num_slots
        self._resolution = resolution
        self._grid = grid_over_map(physics.scenario, resolution)
        self._reaches = {rule: reaches_of(physics, rule, resolution)[0] for rule in mode_rules}
        self._values: dict[str, tuple[list[Values], list[Values], Tensor]] = {}

    def earn_sum_rate(self, power_step: float, draws: int, seed: int) -> None:
        """Let flights earn the secrecy sum-rate, with the best power at each place.

        Args:
            power_step: between the levels of power in dB.
            draws: of a slot's fading and tasks that the expected reward is averaged over.
            seed: of the draws.
        """
        expected, rough = (
            ExpectedReward(self._physics, count, torch.Generator().manual_seed(seed))
            for count in (draws, ROUGH_DRAWS)
        )
        places = self._grid.positions().unsqueeze(1)
        nominal = places.new_ones(len(places), 1)
        maps = best_levels(expected, rough, self._rules, places, nominal, 0, power_step)
        for mode_rule, reward, share in zip(self._rules, *maps, strict=True):
            self._keep(mode_rule, reward, share)

    def earn(self, reward: Reward, draws: int, seed: int) -> None:
        """Let flights earn another reward, at the nominal power.

        Args:
            reward: what a slot earns.
            draws: of a slot's fading and tasks that the expected reward is averaged over.
            seed: of the draws.
        """
        scenario, places = self._physics.scenario, self._grid.positions()
        by_flight = depends_on_velocity(reward, scenario)
        speed = self._resolution / scenario.slot_duration
        for mode_rule, reach in self._reaches.items():
            velocities = torch.from_numpy(reach.displacements) * speed if by_flight else None
            generator = torch.Generator().manual_seed(seed)
            maps = reward_maps(
                self._physics, places, draws, generator, reward, velocities, [mode_rule]
            )
            self._keep(mode_rule, maps[0], places.new_ones(len(places)))

    def _keep(self, mode_rule: str, reward: Tensor, share: Tensor) -> None:
        own = reward.reshape(*reward.shape[:-1], *self._grid.shape).numpy()
        rewards = [own] * self._num_slots
        values = values_to_go(rewards, self._reaches[mode_rule])
        self._values[mode_rule] = rewards, values, share.reshape(self._grid.shape)

    def best(self, mode_rule: str, num_slots: int) -> tuple[Tensor, Tensor]:
        """A path (T + 1, 1, 2) m and powers (T, 1), in units of the nominal power."""
        rewards, values, share = self._values[mode_rule]
        # The reward has no clock, so the values of all horizons are those of the longest's end.
        grid, last = self._grid, slice(len(values) - num_slots, None)
        flight = best_flight(rewards[last], values[last], self._reaches[mode_rule], grid.start)
        rows, columns = flight[1:].T
        return grid.places(flight).unsqueeze(1), share[rows, columns].unsqueeze(1)


def _nominal(scenario: Scenario, modes: Tensor) -> Tensor:
    powers = scenario.jamming_power, scenario.relay_power
    return torch.tensor(powers, dtype=torch.float64, device=modes.device)[modes]
