"""An upper bound on what any flight earns, on the continuous map.

The map is divided into cells, and what a slot earns with each helper in a cell is bounded as
:mod:`hyuav.references.cells` has it. In a slot a helper reaches what lies within its speed limit
of any place in its cell, and of its start within the speed limit of all slots so far. Dynamic
programming over the cells then bounds all flights, and those through each cell. Where flights may
earn most, cells are cut into parts, whose largest reward is that of the cell, until little is left
to gain, or a limit of work is reached: a branch and bound.
"""

import dataclasses
import math
from functools import reduce

import numpy as np
import torch
from numpy.typing import NDArray

from hyuav.physics.modes import allowed_vectors
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.cells import CellRewards, Cells
from hyuav.references.grid import ROUNDING, Values, reaches_of
from hyuav.references.rewards import stratified_fading

FIRST_CELLS, FIRST_RATES = 2**16, 2 * 10**7
"""Cells of all helpers, and rates of a UE by cells, modes, ways, draws and powers, that are bounded
at first, at most."""

MORE_CELLS, MORE_RATES = 2**16, 5 * 10**6
"""The same in parts of cells, in a round."""

ROUNDS = 8
"""In which cells are cut into parts, at most."""

MOST_CELLS = 200
"""Along one side of the map, parts included."""

NEAR = 0.02
"""How much above a known flight a bound is near enough."""

DRAWS = {True: 64, False: 16}
"""Of fading that are averaged over, for one helper and for several."""

WIDTHS = {True: 1.0, False: 15.0}
"""Of an interval of power in dB, at most, likewise."""


class CellBounds:
    """Bounds on the expected returns of flights over any horizon.

    They hold up to the draws over which fading is averaged. The budget E_L of the edge server is
    not kept, which bounds what is earned with it.

    Args:
        physics: of the scenario.
        seed: of the draws.
    """

    def __init__(self, physics: Physics, seed: int) -> None:
        ample = dataclasses.replace(physics.scenario, edge_energy_budget=1e30)
        self._physics = Physics(ample, dtype=torch.float64)
        generator = torch.Generator().manual_seed(seed)
        draws = DRAWS[ample.num_helpers == 1]
        self._rewards = CellRewards(
            self._physics, stratified_fading(self._physics, draws, generator)
        )
        self._maps: dict[str, _Map] = {}

    def of(self, mode_rule: str, num_slots: int, earned: float = -math.inf) -> float:
        """What no flight of so many slots exceeds, in bps/Hz.

        Args:
            mode_rule: who chooses the modes.
            num_slots: T.
            earned: by a known flight, near which bounds need not be improved any more.
        """
        if mode_rule not in self._maps:
            self._maps[mode_rule] = _Map(self._physics.scenario, self._rewards, mode_rule)
        own, enough = self._maps[mode_rule], earned + NEAR * abs(earned)
        for _ in range(ROUNDS):
            through = self._through(own.rewards, mode_rule, num_slots)
            if not own.improve(through, enough):
                return float(through.max())
        return float(self._through(own.rewards, mode_rule, num_slots).max())

    def _through(self, rewards: Values, mode_rule: str, num_slots: int) -> Values:
        """What no flight through each cell exceeds, whenever it comes there: (X, Y, X', ...)."""
        side = self._physics.scenario.map_side / len(rewards)
        reaches = reaches_of(self._physics, mode_rule, side, more=1.0)

        def around(values: Values) -> Values:
            for helper, reach in enumerate(reaches):
                values = reach.best(values, helper)
            return values

        reached = [self._reached(rewards, slot) for slot in range(1, num_slots + 1)]
        since = [rewards]
        for here in reached[:-1]:
            since.append(rewards + around(np.where(here, since[-1], -np.inf)))
        through, to_go = np.full_like(rewards, -np.inf), np.zeros_like(rewards)
        for here in reversed(reached):
            to_go = np.where(here, to_go, -np.inf)
            np.maximum(through, since.pop() + to_go, out=through)
            to_go = around(rewards + to_go)
        return through

    def _reached(self, rewards: Values, slot: int) -> NDArray[np.bool_]:
        """Which cells helpers can have reached in a slot."""
        scenario = self._physics.scenario
        side = scenario.map_side / len(rewards)
        limit = slot * scenario.max_speed * scenario.slot_duration * (1 + 1e-9) + side / 2
        centers = (np.arange(len(rewards)) + 0.5) * side - scenario.map_side / 2
        starts = np.array(scenario.helper_starts).reshape(-1)
        near = [np.abs(centers - start) <= limit for start in starts]
        return reduce(np.logical_and, np.meshgrid(*near, indexing="ij", sparse=True))


class _Map:
    """Bounds of the expected reward under one mode rule, which can be improved.

    Args:
        scenario: whose map it is.
        bounded: bounds rewards in cells.
        mode_rule: who chooses the modes.
    """

    def __init__(self, scenario: Scenario, bounded: CellRewards, mode_rule: str) -> None:
        self._bounded, helpers = bounded, scenario.num_helpers
        self._vectors = allowed_vectors(mode_rule, helpers)
        self._cost = bounded.cost(self._vectors)
        levels = 1
        if scenario.power_control:
            levels = max(math.ceil(scenario.power_range / WIDTHS[helpers == 1]), 1)
        room = min(FIRST_CELLS, FIRST_RATES / (self._cost * levels**helpers))
        count = max(min(int(room ** (0.5 / helpers) * (1 + ROUNDING)), MOST_CELLS), 2)
        self._shape = (count,) * (2 * helpers)
        self._finest = scenario.map_side / MOST_CELLS
        self._parts = Cells.over(scenario, count, levels)
        self._bounds = bounded(self._parts, self._vectors)
        cells = torch.arange(count ** (2 * helpers), device="cpu")
        self._cells = cells.repeat_interleave(levels**helpers)  # of which they are parts

    @property
    def rewards(self) -> Values:
        """Of all helpers' cells, by the largest of their parts: (X, Y, X', Y', ...) bps/Hz."""
        rewards = self._bounds.new_full((math.prod(self._shape),), -torch.inf)
        rewards.scatter_reduce_(0, self._cells, self._bounds, "amax")
        return rewards.reshape(self._shape).numpy()

    def improve(self, through: Values, enough: float) -> bool:
        """Cut those parts in two along each axis in which flights may earn most.

        Args:
            through: what no flight through each cell exceeds, by these rewards.
            enough: what flights may earn without being looked at more closely.

        Returns:
            whether that can lower what no flight exceeds.
        """
        # A flight through a part loses what the part earns less than the best part of the cell.
        others = torch.from_numpy(through - self.rewards).flatten()
        worth = others[self._cells] + self._bounds
        worth[self._parts.side < 2 * self._finest] = -torch.inf
        room = min(MORE_CELLS, MORE_RATES // self._cost) // self._parts.halves
        best = worth.topk(min(room, len(worth)))
        # Where no part of a best flight can be cut any more, it stays.
        least = max(enough, float(through.max()) * (1 - ROUNDING))
        if not room or best.values[0] <= least:
            return False
        cut = best.indices[best.values > enough]
        kept = torch.ones_like(worth, dtype=torch.bool).index_fill_(0, cut, False)
        halves, cells = self._parts.taken(cut).halved(), self._cells[cut]
        self._parts = self._parts.taken(kept).and_more(halves)
        self._bounds = torch.cat([self._bounds[kept], self._bounded(halves, self._vectors)])
        cells = cells.repeat_interleave(halves.halves)
        self._cells = torch.cat([self._cells[kept], cells])
        return True
