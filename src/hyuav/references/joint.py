"""The best flights of several helpers that are found: lower bounds that are nearly tight.

The flights of two helpers are first found together, by dynamic programming over all pairs of
places of a coarse grid; the reach of both is a box in each coordinate, so a backward step is four
one-dimensional maxima. The flights of more helpers begin as straight lines. Then each helper's
flight in turn is the best one with the others' held, on a fine grid, until nothing improves. What
comes out can be flown, so its return is a lower bound of the optimum.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from hyuav.physics.scenario import Point
from hyuav.physics.slot import Physics
from hyuav.references.grid import (
    Grid,
    Reach,
    Values,
    best_flight,
    grid_over_map,
    reaches_of,
    values_to_go,
)
from hyuav.references.power import ROUGH_DRAWS, best_levels, levels_of
from hyuav.references.rewards import ExpectedReward
from hyuav.references.straight import jamming_destinations, relay_destination

COARSE = 10.0
"""Spacing in m of the grid on which two helpers' flights are found together, at least."""

COARSE_LEVELS = 15.0
"""Step in dB between the levels of power that are tried there."""

WINDOW = 10.0
"""By default, how far in m a slot's place moves at most in one improvement."""

TURNS = 60
"""Improvements at most, each of one helper's flight."""


class Plan(NamedTuple):
    """A flight of all helpers before it is flown."""

    path: Tensor
    """(T + 1, H, 2) m."""
    share: Tensor
    """(T, H), powers in units of the nominal one."""


class SeveralHelpers:
    """The best flights of several helpers that are found.

    Args:
        physics: of the scenario, in float64, or in float32 where rough flights will do.
        resolution: spacing in m of the grid on which flights end.
        power_step: between the levels of power in dB.
        draws: of a slot's fading and tasks that the expected reward is averaged over.
        seed: of the draws.
        window: how far in m a slot's place moves at most in one improvement.
    """

    def __init__(
        self,
        physics: Physics,
        resolution: float,
        power_step: float,
        draws: int,
        seed: int,
        window: float = WINDOW,
    ) -> None:
        generator = torch.Generator().manual_seed(seed)
        self._physics, self._resolution, self._step = physics, resolution, power_step
        self._window = window
        self._expected = ExpectedReward(physics, draws, generator)
        self._quiet = ExpectedReward(physics, 1, generator) if draws > 1 else self._expected
        self._rough = ExpectedReward(physics, min(ROUGH_DRAWS, draws), generator)
        helpers = range(physics.scenario.num_helpers)
        self._grids = [grid_over_map(physics.scenario, resolution, helper) for helper in helpers]

    def best(self, mode_rule: str, num_slots: int, turns: int = TURNS) -> Plan:
        """The best flights over so many slots, of beginnings improved in so many turns at most."""
        plans = [
            self._improved(self._quiet, mode_rule, plan, turns)
            for plan in self._beginnings(mode_rule, num_slots)
        ]
        best = max(plans, key=lambda plan: self._quiet.of_flight(mode_rule, *plan))
        return self._improved(self._expected, mode_rule, best, turns)

    def improved(self, mode_rule: str, plan: Plan, turns: int) -> Plan:
        """A flight on the helpers' grids, improved in so many turns at most."""
        return self._improved(self._expected, mode_rule, plan, turns)

    def _beginnings(self, mode_rule: str, num_slots: int) -> Iterator[Plan]:
        """Flights to begin with."""
        if self._physics.scenario.num_helpers == 2:
            yield self._joint_plan(mode_rule, num_slots)
        else:
            yield from self.straight(num_slots)

    def straight(self, num_slots: int) -> Iterator[Plan]:
        """Straight flights of some helpers to where they jam best, of the others to relay."""
        scenario = self._physics.scenario
        jamming, relay = jamming_destinations(scenario), relay_destination(scenario)
        for jammers in range(scenario.num_helpers + 1):
            ends = [*jamming[:jammers], *[relay] * (scenario.num_helpers - jammers)]
            path = _straight(self._physics, ends, num_slots)
            yield Plan(path, path.new_ones(num_slots, scenario.num_helpers))

    def _joint_plan(self, mode_rule: str, num_slots: int) -> Plan:
        """The best flight of two helpers on a coarse grid."""
        spacing = max(COARSE, self._resolution)
        grids = [grid_over_map(self._physics.scenario, spacing, helper) for helper in range(2)]
        reaches = reaches_of(self._physics, mode_rule, spacing)
        rewards, power = self._joint_rewards(mode_rule, grids)
        values = [np.zeros_like(rewards)]
        for _ in range(num_slots - 1):
            best = rewards + values[-1]
            for helper, reach in enumerate(reaches):
                best = reach.best(best, helper)
            values.append(best)
        points = [grid.start for grid in grids]
        flight, chosen = [points], []
        for value in reversed(values):
            one, other = (
                reach.within(grid, point)
                for reach, grid, point in zip(reaches, grids, points, strict=True)
            )
            both = one[:, :, None, None] & other
            points = _nearest_best(np.where(both, rewards + value, -np.inf), points)
            flight.append(points)
            chosen.append(power[(*points[0], *points[1])])
        steps = np.array(flight)
        places = [grid.places(steps[:, helper]) for helper, grid in enumerate(grids)]
        return Plan(torch.stack(places, dim=1), torch.stack(chosen))

    def _joint_rewards(self, mode_rule: str, grids: Sequence[Grid]) -> tuple[Values, Tensor]:
        """Of all pairs of places with their best powers: (X, Y, X', Y'), and (..., 2)."""
        one, other = (grid.positions() for grid in grids)
        size = len(one), len(other)
        pairs = torch.stack(
            [one.unsqueeze(1).expand(*size, 2), other.expand(*size, 2)], dim=-2
        ).flatten(0, 1)
        levels = levels_of(self._physics.scenario, COARSE_LEVELS).tolist()
        best = pairs.new_full((len(pairs),), -torch.inf)
        power = pairs.new_ones(len(pairs), 2)
        for both in product(levels, repeat=2):
            own = pairs.new_tensor(both).expand_as(power)
            reward = self._quiet([mode_rule], pairs, own)[0]
            better = (reward > best).unsqueeze(-1)
            power, best = torch.where(better, own, power), torch.maximum(best, reward)
        shape = *grids[0].shape, *grids[1].shape
        return best.reshape(shape).numpy(), power.reshape(*shape, 2)

    def _improved(
        self, expected: ExpectedReward, mode_rule: str, plan: Plan, turns: int = TURNS
    ) -> Plan:
        """Flights improved in turn until none improves."""
        reaches = reaches_of(self._physics, mode_rule, self._resolution)
        value, unimproved = expected.of_flight(mode_rule, *plan), 0
        for turn in range(turns):
            helper = turn % len(reaches)
            own = self._best_of_one(expected, mode_rule, plan, helper, reaches[helper])
            found = expected.of_flight(mode_rule, *own)
            unimproved += 1
            if found > value + 1e-9:
                plan, value, unimproved = own, found, 0
            if unimproved == len(reaches):
                break
        return plan

    def _best_of_one(
        self, expected: ExpectedReward, mode_rule: str, plan: Plan, helper: int, reach: Reach
    ) -> Plan:
        """The plan with one helper's flight as good as can be near its own, the others' held."""
        (path, power), grid = plan, self._grids[helper]
        positions = grid.positions().to(path)
        rough = expected if expected is self._quiet else self._rough
        held = torch.cat([path[1:], power.unsqueeze(-1)], dim=-1)
        held[:, helper] = 1.0
        others, group = held.unique(dim=0, return_inverse=True)
        near = (positions - path[1:, helper].unsqueeze(1)).abs() <= self._window
        slot, own = near.all(dim=-1).nonzero(as_tuple=True)
        # Where the others hover, slots bring the same.
        case, index = (group[slot] * len(positions) + own).unique(return_inverse=True)
        candidates, shares = others[case // len(positions)].split([2, 1], dim=-1)
        candidates[:, helper] = positions[case % len(positions)]
        found, level = (
            each[0][index]
            for each in best_levels(
                expected, rough, [mode_rule], candidates, shares.squeeze(-1), helper, self._step
            )
        )
        rewards, levels = path.new_full((2, len(power), len(positions)), -torch.inf)
        rewards[slot, own], levels[slot, own] = found, level
        rewards = rewards.reshape(-1, *grid.shape).numpy()
        levels = levels.reshape(-1, *grid.shape)
        flight = best_flight(rewards, values_to_go(rewards, reach), reach, grid.start)
        path, power = path.clone(), power.clone()
        path[:, helper] = grid.places(flight).to(path)
        row, column = flight[1:].T
        power[:, helper] = levels[torch.arange(len(levels)), row, column]
        return Plan(path, power)


def _straight(physics: Physics, destinations: Sequence[Point], num_slots: int) -> Tensor:
    """Straight flights, as fast as half the speed limit, and then hovering: (T + 1, H, 2) m."""
    scenario, starts = physics.scenario, physics.nodes.helper
    way = starts.new_tensor(destinations) - starts
    step = scenario.max_speed * scenario.slot_duration / 2
    slots = torch.arange(num_slots + 1, dtype=starts.dtype, device=starts.device).reshape(-1, 1, 1)
    length = torch.linalg.vector_norm(way, dim=-1, keepdim=True).clamp(min=1e-9)
    return starts + way * (slots * step / length).clamp(max=1.0)


def _nearest_best(values: Values, points: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The grid points with the largest value; of equals those nearest to ``points``."""
    best = np.argwhere(values == values.max())
    moved = ((best - np.concatenate(points)) ** 2).sum(axis=-1)
    row, column, other_row, other_column = (int(index) for index in best[moved.argmin()])
    return [(row, column), (other_row, other_column)]
