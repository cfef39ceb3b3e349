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
from hyuav.physics.modes import MODE_RULES, fixed_modes
from hyuav.physics.scenario import Scenario, ScenarioLike, as_scenario
from hyuav.physics.slot import Physics
from hyuav.references.bounds import CellBounds
from hyuav.references.flight import flyable
from hyuav.references.grid import (
    Reach,
    Values,
    best_flight,
    grid_over_map,
    reaches_of,
    values_to_go,
)
from hyuav.references.joint import SeveralHelpers
from hyuav.references.power import best_levels
from hyuav.references.rewards import ExpectedReward, estimate_return

RESOLUTION = 1.0
"""Default grid spacing in metres: halving it moves no preset's value by 0.2 %."""

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
    """Expected undiscounted return of the flight in bps/Hz, from draws that did not choose it."""
    standard_error: float
    """Of ``value`` in bps/Hz; 0 where no slot is random."""
    path: Tensor
    """(T + 1, H, 2) m, float64: where the helpers are before the first slot and in each slot."""
    modes: Tensor
    """(T, H) int64: 1 relay, 0 jamming. Of the hybrid, relay where expected C_1 exceeds C_0."""
    power: Tensor
    """(T, H) W, float64: what the helpers send at in these modes."""
    share: Tensor
    """(T, H): the same in units of the nominal power."""
    upper_bound: float | None = None
    """Of what any flight earns, in bps/Hz; None where none is computed."""


def solve_optimum(
    scenario: ScenarioLike,
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float = RESOLUTION,
    power_step: float = 1.0,
    draws: int = 256,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    certify: bool = False,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
) -> dict[str, Optimum]:
    """The best flight under each mode rule over the scenario's T slots.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        mode_rules: who may choose the modes: of :data:`hyuav.physics.modes.MODE_RULES`, or a
            letter r or j for each helper.
        resolution: spacing of the grid in m; the helpers' starts are grid points.
        power_step: between the levels of power that are tried, in dB, where it is controlled.
        draws: of a slot's fading and tasks that the expected reward is averaged over, the same
            at all positions. They choose the flight and nothing else.
        evaluation_draws: of whole episodes, from which the flight's value is estimated.
        seed: of all draws; not used where no slot is random.
        certify: give the upper bound too, which takes some seconds; always given for several
            helpers.
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
        power_step=power_step,
        draws=draws,
        evaluation_draws=evaluation_draws,
        seed=seed,
        certify=certify,
        track=track,
    )
    return {mode_rule: optima[scenario.num_slots] for mode_rule, optima in found.items()}


def solve_horizons(
    scenario: ScenarioLike,
    horizons: Sequence[int],
    mode_rules: Sequence[str] = MODE_RULES,
    *,
    resolution: float = RESOLUTION,
    power_step: float = 1.0,
    draws: int = 256,
    evaluation_draws: int = 10_000,
    seed: int = 0,
    certify: bool = False,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
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
        certify: give upper bounds too.
        track: passes on the mode rules.

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
    draws = checked(_Draws, "draws", draws)
    evaluation_draws = checked(_Draws, "evaluation_draws", evaluation_draws)
    resolution = plain(resolution)
    require_resolution(resolution, scenario.map_side, longest)
    root = torch.Generator().manual_seed(as_seed(seed))
    map_seed, evaluation_seed = torch.randint(2**62, (2,), generator=root, device="cpu").tolist()

    physics = Physics(scenario, dtype=torch.float64)
    one = scenario.num_helpers == 1
    planner: _OneHelper | SeveralHelpers = (
        _OneHelper(physics, mode_rules, longest, resolution, power_step, draws, map_seed)
        if one
        else SeveralHelpers(physics, resolution, power_step, draws, map_seed)
    )
    bounds = CellBounds(physics, map_seed) if certify or not one else None
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
                None if bounds is None else bounds.of(mode_rule, horizon),
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


class _OneHelper:
    """The best flights of one helper on a grid, under every mode rule and over every horizon.

    Args:
        physics: in float64.
        mode_rules: that are asked for.
        num_slots: the longest horizon.
        resolution: spacing of the grid in m.
        power_step: between the levels of power in dB.
        draws: of a slot's fading and tasks that the expected reward is averaged over.
        seed: of the draws.
    """

    def __init__(
        self,
        physics: Physics,
        mode_rules: Sequence[str],
        num_slots: int,
        resolution: float,
        power_step: float,
        draws: int,
        seed: int,
    ) -> None:
        expected = ExpectedReward(physics, draws, torch.Generator().manual_seed(seed))
        quiet = ExpectedReward(physics, 1, torch.Generator().manual_seed(seed))
        self._grid = grid_over_map(physics.scenario, resolution)
        places = self._grid.positions().unsqueeze(1)
        nominal = places.new_ones(len(places), 1)
        rewards, shares = best_levels(expected, quiet, mode_rules, places, nominal, 0, power_step)
        self._maps: dict[str, tuple[list[Values], list[Values], Reach, Tensor]] = {}
        for mode_rule, reward, share in zip(mode_rules, rewards, shares, strict=True):
            of_slots = [reward.reshape(self._grid.shape).numpy()] * num_slots
            (reach,) = reaches_of(physics, mode_rule, resolution)
            values = values_to_go(of_slots, reach)
            self._maps[mode_rule] = of_slots, values, reach, share.reshape(self._grid.shape)

    def best(self, mode_rule: str, num_slots: int) -> tuple[Tensor, Tensor]:
        """A path (T + 1, 1, 2) m and powers (T, 1), in units of the nominal power."""
        rewards, values, reach, share = self._maps[mode_rule]
        # The reward has no clock, so the values of all horizons are those of the longest's end.
        grid, last = self._grid, slice(len(values) - num_slots, None)
        flight = best_flight(rewards[last], values[last], reach, grid.start)
        rows, columns = flight[1:].T
        return grid.places(flight).unsqueeze(1), share[rows, columns].unsqueeze(1)


def _nominal(scenario: Scenario, modes: Tensor) -> Tensor:
    powers = scenario.jamming_power, scenario.relay_power
    return torch.tensor(powers, dtype=torch.float64, device=modes.device)[modes]
