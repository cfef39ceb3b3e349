"""An upper bound on what any flight earns, on the continuous map.

The map is divided into cells. The reward of a cell, or of a pair of cells for two helpers, is
bounded by the reward with each link as good as it can be from anywhere in the cell: a relay is as
near to L and its UEs as possible and as far from the eavesdroppers, a jammer the other way round.
In a slot a helper reaches what lies within its speed limit of any place in its cell, and of its
start within the speed limit of all slots so far. Dynamic programming over the cells then bounds
all flights.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from hyuav.physics import channel
from hyuav.physics.channel import Links, pairs
from hyuav.physics.modes import allowed_vectors
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Geometry, Physics
from hyuav.references.grid import Values, reaches_of
from hyuav.references.rewards import stratified_fading

MOST_RATES = 8 * 10**6
"""Rates of a UE, by cells of all helpers, their modes, ways, draws and powers, that are bounded."""

MOST_CELLS = 200
"""Along one side of the map."""

DRAWS = {True: 64, False: 16}
"""Of fading and tasks that are averaged over, for one helper and for several."""

WIDTH = 1.0
"""Of an interval of power in dB, at most."""

_CHUNK = 2**16
"""Cells and draws computed at once."""


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
        self._helpers = range(ample.num_helpers)
        draws = DRAWS[ample.num_helpers == 1]
        generator = torch.Generator().manual_seed(seed)
        self._fading = stratified_fading(self._physics, draws, generator)
        self._draws = 1 if self._fading is None else draws
        self._powers = _intervals(ample)
        # In each mode a UE has a way through each relay, and straight where a helper jams.
        ways = ample.num_helpers * 2 ** (ample.num_helpers - 1) + 2**ample.num_helpers - 1
        room = MOST_RATES / (self._draws * len(self._powers) * ways)
        self._count = max(min(int(room ** (0.5 / ample.num_helpers)), MOST_CELLS), 2)
        self._side = ample.map_side / self._count
        axis = (torch.arange(self._count, dtype=torch.float64, device="cpu") + 0.5) * self._side
        axis -= ample.map_side / 2
        self._centers = torch.cartesian_prod(axis, axis)
        self._rewards: dict[str, Values] = {}

    def of(self, mode_rule: str, num_slots: int) -> float | None:
        """What no flight of so many slots exceeds, in bps/Hz.

        None where the powers of several helpers are controlled.
        """
        if len(self._powers) > 1 and len(self._helpers) > 1:
            return None
        if mode_rule not in self._rewards:
            self._rewards[mode_rule] = self._bounded(mode_rule)
        reward = self._rewards[mode_rule]
        reaches = reaches_of(self._physics, mode_rule, self._side, more=1.0)
        best = reward
        for slot in range(num_slots, 0, -1):
            for helper in self._helpers:
                best = np.where(self._reached(helper, slot, reward.ndim), best, -np.inf)
            if slot > 1:
                for helper, reach in enumerate(reaches):
                    best = reach.best(best, helper)
                best = reward + best
        return float(best.max())

    def _reached(self, helper: int, slot: int, axes: int) -> NDArray[np.bool_]:
        """Which cells a helper can have reached in a slot, along its two of so many axes."""
        scenario = self._physics.scenario
        away = (self._centers - self._physics.nodes.helper[helper]).abs() - self._side / 2
        limit = slot * scenario.max_speed * scenario.slot_duration * (1 + 1e-9)
        shape = [1] * axes
        shape[2 * helper : 2 * helper + 2] = [self._count] * 2
        return (away <= limit).all(dim=-1).reshape(shape).numpy()

    def _bounded(self, mode_rule: str) -> Values:
        """The bound of the expected reward for all cells of all helpers: (X, Y, X', Y', ...)."""
        num_helpers = len(self._helpers)
        vectors = allowed_vectors(mode_rule, num_helpers)
        own = torch.arange(len(self._centers), device="cpu")
        cells = torch.cartesian_prod(*[own] * num_helpers).reshape(-1, num_helpers)
        bounds = []
        for part in cells.split(max(_CHUNK // self._draws, 1)):
            sums = [
                _bound(self._physics, self._centers[part], self._side, vector, power, self._fading)
                for vector in vectors
                for power in self._powers
            ]
            of_draws = torch.stack(sums).reshape(len(vectors), len(self._powers), len(part), -1)
            bounds.append(of_draws.amax(dim=0).mean(dim=-1).amax(dim=0))
        return torch.cat(bounds).reshape([self._count] * (2 * num_helpers)).numpy()


Interval = tuple[float, float]


def _intervals(scenario: Scenario) -> list[Interval]:
    """Of the powers that can be chosen, in units of the nominal power: from, to."""
    if not scenario.power_control:
        return [(1.0, 1.0)]
    count = math.ceil(scenario.power_range / WIDTH)
    ends = [10.0 ** (-scenario.power_range * step / count / 10.0) for step in range(count + 1)]
    return [(low, high) for high, low in itertools.pairwise(ends)]


def _bound(
    physics: Physics,
    centers: Tensor,
    side: float,
    relays: Sequence[bool],
    power: Interval,
    fading: Links | None,
) -> Tensor:
    """The largest sum-rate with helpers anywhere in cells (P, H, 2) m, in given modes: (P, draws).

    A power goes where it helps at its largest, and where it harms at its least.
    """
    scenario, standing = physics.scenario, physics.standing(physics.nodes)
    cells, (least, most) = centers.unsqueeze(1), power
    nearest, farthest = _span(cells.unsqueeze(-2), standing.positions, side / 2)
    relaying = torch.tensor(relays, device="cpu").unsqueeze(-1)
    to_ues, near_l, near_e = physics.by_role(nearest)
    _, far_l, far_e = physics.by_role(farthest)
    climb = scenario.altitude - scenario.eavesdropper_altitude
    first, second = ([pair[end] for pair in pairs(scenario.num_helpers)] for end in (0, 1))
    _, apart = _span(cells[..., first, :], cells[..., second, :], side)
    ue_to_helper = to_ues.mT
    to_legitimate = channel.air_to_air(scenario, torch.where(relaying, near_l, far_l), 0.0)
    to_eavesdroppers = channel.air_to_air(scenario, torch.where(relaying, far_e, near_e), climb)
    gains = Links(
        standing.legitimate_gain,
        channel.ground_to_air(scenario, ue_to_helper, scenario.altitude),
        standing.eavesdropper_gain,
        (to_legitimate * torch.where(relaying, most, least)).squeeze(-1),
        to_eavesdroppers * torch.where(relaying, least, most),
        channel.air_to_air(scenario, apart, 0.0) * least,
    ).faded(fading)
    geometry = Geometry(nearest, ue_to_helper, standing, gains)
    sum_rate = physics.outcomes(geometry, gains, None, vectors=[relays])[0].sum_rate
    return sum_rate.expand(len(centers), -1)


def _span(centers: Tensor, others: Tensor, half: float) -> tuple[Tensor, Tensor]:
    """The least and the largest distance from squares of these half sides to points, in m."""
    away = (centers - others).abs()
    nearest = torch.linalg.vector_norm((away - half).clamp(min=0.0), dim=-1)
    return nearest, torch.linalg.vector_norm(away + half, dim=-1)
