"""Backward dynamic programming over a grid of helper positions."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from torch import Tensor

from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics

Values = NDArray[np.float64]

ROUNDING = 1e-9
"""Relative: a grid point closer than this to a limit (map edge, speed limit) lies on it."""


class Grid(NamedTuple):
    """The points start + resolution (i, j) that lie on the map, its edges included."""

    x: Values
    """(X,) m."""
    y: Values
    """(Y,) m."""
    start: tuple[int, int]
    """Row and column of the helper's start."""

    @property
    def shape(self) -> tuple[int, int]:
        """(X, Y)."""
        return len(self.x), len(self.y)

    def places(self, points: NDArray[np.int64]) -> Tensor:
        """Where rows and columns (..., 2) of the grid are: (..., 2) m."""
        rows, columns = points[..., 0], points[..., 1]
        return torch.from_numpy(np.stack([self.x[rows], self.y[columns]], axis=-1))

    def positions(self) -> Tensor:
        """All grid points, row by row: (X * Y, 2) m."""
        axes = torch.from_numpy(self.x), torch.from_numpy(self.y)
        return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 2)


def grid_over_map(scenario: Scenario, resolution: float, helper: int = 0) -> Grid:
    """The grid anchored at a helper's start.

    Args:
        scenario: gives the start and the map's side.
        resolution: spacing in m.
        helper: which one's, counted from 0.
    """
    half = scenario.map_side / 2
    axes, origin = [], []
    for coordinate in scenario.helper_starts[helper]:
        before = int((half + coordinate) / resolution * (1 + ROUNDING))
        after = int((half - coordinate) / resolution * (1 + ROUNDING))
        axis = coordinate + resolution * np.arange(-before, after + 1)
        axes.append(axis.clip(-half, half))
        origin.append(before)
    return Grid(axes[0], axes[1], (origin[0], origin[1]))


def reaches_of(
    physics: Physics, mode_rule: str, spacing: float, more: float = 0.0
) -> list["Reach"]:
    """What each helper reaches in a slot on a grid.

    Args:
        physics: of the scenario.
        mode_rule: whose transmission energy counts against E_H.
        spacing: of the grid in m.
        more: how many spacings farther along each axis.
    """
    scenario = physics.scenario
    spacings = scenario.slot_duration / spacing
    limits = physics.norm_limit([mode_rule])
    norms = [math.inf] * scenario.num_helpers if limits is None else limits[0].tolist()
    across = scenario.map_side / spacing + 1
    box = min(scenario.max_speed * spacings + more, across)
    return [Reach(box, norm * spacings + more * math.sqrt(2.0)) for norm in norms]


class Reach:
    """The grid points that one slot of flight reaches: a box cut by a disc, as a union of boxes.

    A discrete disc is the union of the boxes inscribed in it, and the largest value in a box is
    separable into its rows and columns. The box of reading 5 alone is a union of one.

    Args:
        box: largest displacement along each axis, in grid spacings.
        disc: largest norm of the displacement, in grid spacings; infinity for none.
    """

    def __init__(self, box: float, disc: float) -> None:
        box, disc = box * (1 + ROUNDING), disc * (1 + ROUNDING)
        rows = np.arange(int(min(box, disc)) + 1)
        columns = np.sqrt(np.maximum(disc**2 - rows**2, 0.0)).clip(max=box).astype(int)
        # Of the boxes of equal width only the tallest counts: the last row of each width.
        last = np.append(columns[1:] < columns[:-1], True)
        self.boxes = list(zip(rows[last].tolist(), columns[last].tolist(), strict=True))
        offsets = np.arange(-rows[-1], rows[-1] + 1)
        self._squared_norm = offsets[:, None] ** 2 + offsets**2
        self._reachable = np.abs(offsets) <= columns[np.abs(offsets)][:, None]

    @property
    def displacements(self) -> NDArray[np.int64]:
        """All that one slot of flight allows, in grid spacings: (D, 2)."""
        return np.argwhere(self._reachable) - self._reachable.shape[0] // 2

    def best(self, values: Values, helper: int = 0) -> Values:
        """The largest value within a helper's reach of each grid point.

        Args:
            values: (X, Y), of arriving at each grid point, or (D, X, Y), by each displacement; or
                those of all pairs, ... of helpers' grid points, (X, Y, X', Y', ...).
            helper: which of them flies.
        """
        if values.ndim == 3:
            return self._best_of_each(values)
        best = np.full_like(values, -np.inf)
        own = slice(2 * helper, 2 * helper + 2)
        for half_widths in self.boxes:
            size = [1] * values.ndim
            # A window cannot reach further than across the grid.
            widths = zip(half_widths, values.shape[own], strict=True)
            size[own] = [2 * min(h, n - 1) + 1 for h, n in widths]
            # Repeating the edge adds no value that the cut window does not hold already.
            np.maximum(best, maximum_filter(values, size, mode="nearest"), out=best)
        return best

    def _best_of_each(self, values: Values) -> Values:
        best = np.full(values.shape[1:], -np.inf)
        for arriving, displacement in zip(values, self.displacements, strict=True):
            shape: tuple[int, ...] = best.shape
            moves: list[int] = displacement.tolist()
            moved = list(zip(moves, shape, strict=True))
            here = tuple(slice(max(-move, 0), size - max(move, 0)) for move, size in moved)
            there = tuple(slice(max(move, 0), size - max(-move, 0)) for move, size in moved)
            np.maximum(best[here], arriving[there], out=best[here])
        return best

    def within(self, grid: Grid, point: tuple[int, int]) -> NDArray[np.bool_]:
        """Which grid points (X, Y) are within reach of one."""
        span = self._reachable.shape[0] // 2
        rows = np.arange(grid.shape[0]) - point[0]
        columns = np.arange(grid.shape[1]) - point[1]
        near = (np.abs(rows) <= span)[:, None] & (np.abs(columns) <= span)
        row, column = (np.clip(offsets, -span, span) + span for offsets in (rows, columns))
        return near & self._reachable[row[:, None], column]

    def argbest(self, values: Values, point: tuple[int, int]) -> tuple[int, int]:
        """The grid point with the largest value within reach of ``point``; of equals the nearest.

        Args:
            values: (X, Y) or (D, X, Y), as for :meth:`best`.
            point: row and column.
        """
        if values.ndim == 3:
            ends = self.displacements + point
            inside = ((ends >= 0) & (ends < values.shape[1:])).all(axis=1)
            worth = np.full(len(ends), -np.inf)
            worth[inside] = values[inside, *ends[inside].T]
            norms = np.square(self.displacements).sum(axis=1)
            row, column = ends[np.where(worth == worth.max(), norms, np.inf).argmin()]
            return int(row), int(column)
        span = self._reachable.shape[0] // 2
        low = [max(index - span, 0) for index in point]
        grid_window = tuple(
            slice(first, index + span + 1) for first, index in zip(low, point, strict=True)
        )
        window = values[grid_window]
        own = tuple(
            slice(first - index + span, first - index + span + length)
            for first, index, length in zip(low, point, window.shape, strict=True)
        )
        window = np.where(self._reachable[own], window, -np.inf)
        distance = np.where(window == window.max(), self._squared_norm[own], np.inf)
        row, column = np.unravel_index(distance.argmin(), distance.shape)
        return int(row) + low[0], int(column) + low[1]


def values_to_go(rewards: Sequence[Values], reach: Reach) -> list[Values]:
    """What can still be earned after each slot, from every grid point.

    V_t(x) = max over x' within reach of x of [reward_{t+1}(x') + V_{t+1}(x')] and V_T = 0.

    Args:
        rewards: of the T slots, expected at each grid point, (X, Y), -infinity for one where the
            helper may not be; or by the displacement that leads there, (D, X, Y).
        reach: of one slot.

    Returns:
        T arrays (X, Y) in bps/Hz.
    """
    values = [np.zeros(rewards[-1].shape[-2:])]
    for reward in reversed(rewards[1:]):
        values.append(reach.best(reward + values[-1]))
    return values[::-1]


def best_flight(
    rewards: Sequence[Values], values: Sequence[Values], reach: Reach, start: tuple[int, int]
) -> NDArray[np.int64]:
    """The best flight from a grid point: rows and columns of the grid, (T + 1, 2).

    Args:
        rewards: of the T slots, (X, Y) bps/Hz.
        values: what :func:`values_to_go` gives for them.
        reach: of one slot.
        start: row and column.
    """
    flight = [start]
    for reward, value in zip(rewards, values, strict=True):
        flight.append(reach.argbest(reward + value, flight[-1]))
    return np.array(flight)
