"""What is known of a scenario before a helper flies, as the generalist sees it: maps and nodes.

The physics is known, so a map tells what one slot brings with the helper at each place of a
lattice. Views are cut out of it around the helper, fine nearby and coarse far away: they cover the
whole map and have the same size in every scenario. The nodes themselves are a set of tokens.
"""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.grid import grid_over_map, reaches_of
from hyuav.references.power import best_levels
from hyuav.references.rewards import ExpectedReward

STEPS = 10
"""Spacings of the lattice that a helper flies along each axis in a slot, at its fastest."""

MOST_SPACINGS = 400
"""Along one side of the map: a slower helper flies fewer of them in a slot."""

REACH = 2 * STEPS + 1
"""Places within reach along each axis."""

VIEWS = ((2, 21), (6, 11), (12, 17))
"""The spacing of each view's places, in those of the lattice, and how many there are per side."""

VIEW_SIZE = sum(count**2 for _, count in VIEWS)

DRAWS, ROUGH_DRAWS = 16, 2
"""Of a slot's fading, over which what it brings is averaged, the same at all places; and how many
of them tell roughly at which power."""

POWER_STEP, ROUGH_STEP = 5.0, 15.0
"""Between the levels of power that are tried at each place, in dB, for one helper and several."""

EDGE = 1e-4
"""In m, what is taken off the radius of coverage."""

OUTSIDE = -1.0
"""What a map tells beyond the edge of the world; rewards are from 0 to 1."""

TURNS = tuple(
    torch.tensor(turn)
    for turn in (
        *([[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]),
        *([[-1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1], [-1, 0]]),
    )
)
"""The symmetries of the map: four turns, and the same behind a mirror."""


def offsets(spacing: int, count: int) -> Tensor:
    """A square of places around a helper, in spacings of the lattice: (count^2, 2)."""
    axis = (torch.arange(count) - count // 2) * spacing
    return torch.cartesian_prod(axis, axis)


CANDIDATES = offsets(1, REACH)
"""Where a helper may be in the next slot, from where it is: (REACH^2, 2) spacings."""


def window(
    side: int,
    place: Tensor,
    spacing: int,
    count: int,
    turns: Tensor,
    begin: Tensor | None = None,
) -> Tensor:
    """Where a square of places around each helper stands in its map: (B, count^2) int64.

    Args:
        side: of the map; what lies beyond it stands at its end, side^2 places from its beginning.
        place: (B, 2) int64, row and column of each helper.
        spacing: of the square's places, in those of the lattice.
        count: of its places along each side, odd.
        turns: (B, 2, 2) int64, one of :data:`TURNS` each: the square's axes lead along rows and
            columns, or the other way, forward or back. Or (1, 2, 2), of all.
        begin: where each one's map begins, (B,) int64; None for 0.
    """
    along = turns.abs().argmax(dim=1)
    sign = turns.sum(dim=1).unsqueeze(-1)
    axis = (torch.arange(count, device=place.device) - count // 2) * spacing
    at = place.gather(1, along.expand_as(place)).unsqueeze(-1) + sign * axis
    stride = torch.where(along == 0, side, 1).unsqueeze(-1)
    first, second = (at * stride).where((at >= 0) & (at < side), side**2).unbind(dim=1)
    begin = place.new_zeros(1) if begin is None else begin
    first = first + begin.unsqueeze(-1)
    end = (begin + side**2).reshape(-1, 1, 1)
    return (first.unsqueeze(-1) + second.unsqueeze(-2)).clamp_max_(end).flatten(1)


class Others(NamedTuple):
    """Where helpers are that others decide about."""

    places: Tensor
    """(H, 2) m."""
    power: Tensor
    """(H,), in units of the nominal one."""


@dataclass(frozen=True, eq=False)
class Scenes:
    """What is known of helpers' worlds, with an axis of scenes in front; all maps are square."""

    rewards: Tensor
    """What a slot brings at each place, 1 at the best one, :data:`OUTSIDE` off the map: one row of
    side^2 places and one for all that lies outside."""
    views: Tensor
    """The best nearby: the same for each of :data:`VIEWS`, (len(VIEWS), side^2 + 1)."""
    shares: Tensor
    """The power that brings it, in units of the nominal one: (side^2 + 1,)."""
    reachable: Tensor
    """(REACH^2,) bool: which of :data:`CANDIDATES` one slot of flight reaches."""
    best: Tensor
    """(1,) bps/Hz: what 1 stands for."""
    corner: Tensor
    """(2,) m: the first place of the lattice."""
    spacing: Tensor
    """(1,) m, of the lattice."""
    start: Tensor
    """(2,) int64: row and column where the helper starts."""
    num_slots: Tensor
    """(1,) int64: T."""

    @classmethod
    def joined(cls, several: Iterable[Self]) -> Self:
        """All scenes in a row; their maps are of one size."""
        columns = zip(*(own.entries().values() for own in several), strict=True)
        return cls(*(torch.cat(parts) for parts in columns))

    def entries(self) -> dict[str, Tensor]:
        """All of them, by name."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    def to(self, device: torch.device | str) -> Self:
        """The same on a device."""
        return type(self)(*(values.to(device) for values in self.entries().values()))

    @property
    def count(self) -> int:
        """S, how many scenes there are."""
        return len(self.start)

    @property
    def side(self) -> int:
        """Places along one side of the maps."""
        return round((self.rewards.shape[-1] - 1) ** 0.5)

    def seen(self, view: int, scene: Tensor, place: Tensor, turns: Tensor) -> Tensor:
        """What helpers see in one of :data:`VIEWS`: (B, count^2).

        Args:
            view: its number.
            scene: (B,) int64, of each helper.
            place: (B, 2) int64, of each helper.
            turns: as for :func:`window`.
        """
        begin = (scene * len(VIEWS) + view) * self.views.shape[-1]
        return _read(self.views, window(self.side, place, *VIEWS[view], turns, begin))

    def rewards_at(self, scene: Tensor, cell: Tensor) -> Tensor:
        """What a slot brings in cells (B, K) of the maps of scenes (B,): (B, K)."""
        return _read(self.rewards, cell + (scene * self.rewards.shape[-1]).unsqueeze(-1))


def _read(maps: Tensor, index: Tensor) -> Tensor:
    """All maps' numbers at places (B, K) of them in a row."""
    return maps.view(-1).index_select(0, index.flatten()).view_as(index)


def scenes_of(
    scenario: Scenario, mode_rule: str, draws: int = DRAWS, others: Others | None = None
) -> Scenes:
    """What is known of a scenario under a mode rule: a scene for each helper.

    Args:
        scenario: that is flown.
        mode_rule: who chooses the modes.
        draws: of a slot's fading that rewards are averaged over; 1 leaves it out.
        others: where each helper sees the others, and their powers; None for their starts.
    """
    # Whoever flies is warned of coverage by the scenario itself.
    physics = Physics(_within_coverage(scenario), dtype=torch.float32, layout_is_known=False)
    rough = ExpectedReward(physics, min(ROUGH_DRAWS, draws), torch.Generator().manual_seed(0))
    expected = rough
    if draws > ROUGH_DRAWS:
        expected = ExpectedReward(physics, draws, torch.Generator().manual_seed(0))
    starts = physics.nodes.helper
    seen = others or Others(starts, starts.new_ones(len(starts)))
    scenes = [
        _scene_of_one(expected, rough, mode_rule, helper, seen)
        for helper in range(scenario.num_helpers)
    ]
    return Scenes.joined(scenes)


def _within_coverage(scenario: Scenario) -> Scenario:
    """The same without the edge of coverage, which a flight in float32 may miss."""
    radius = max(scenario.coverage_radius - EDGE, 0.0)
    return dataclasses.replace(scenario, coverage_radius=radius)


def _scene_of_one(
    expected: ExpectedReward,
    rough: ExpectedReward,
    mode_rule: str,
    helper: int,
    others: Others,
) -> Scenes:
    physics = expected.physics
    scenario = physics.scenario
    spacing = max(
        scenario.max_speed * scenario.slot_duration / STEPS, scenario.map_side / MOST_SPACINGS
    )
    grid = grid_over_map(scenario, spacing, helper)
    own = grid.positions().to(physics.dtype)
    places, power = (each.expand(len(own), *each.shape).clone() for each in others)
    places[:, helper] = own
    power_step = POWER_STEP if scenario.num_helpers == 1 else ROUGH_STEP
    rewards, shares = best_levels(expected, rough, [mode_rule], places, power, helper, power_step)
    best = float(rewards.max())
    side = int(scenario.map_side / spacing * (1 + 1e-9)) + 1
    normalized = _square(rewards.reshape(grid.shape) / max(best, 1e-9), side, OUTSIDE)
    near = [_best_nearby(normalized, step + 1 - step % 2) for step, _ in VIEWS]
    return Scenes(
        rewards=_with_outside(normalized, OUTSIDE).unsqueeze(0),
        views=torch.stack([_with_outside(view, OUTSIDE) for view in near]).half().unsqueeze(0),
        shares=_with_outside(_square(shares.reshape(grid.shape), side, 1.0), 1.0).unsqueeze(0),
        reachable=_reachable(physics, mode_rule, spacing, helper).unsqueeze(0),
        best=torch.tensor([[best]]),
        corner=torch.tensor([[grid.x[0], grid.y[0]]], dtype=torch.float32),
        spacing=torch.tensor([[spacing]]),
        start=torch.tensor([grid.start]),
        num_slots=torch.tensor([[scenario.num_slots]]),
    )


def _square(values: Tensor, side: int, beyond: float) -> Tensor:
    rows, columns = values.shape
    return F.pad(values, (0, side - columns, 0, side - rows), value=beyond)


def _with_outside(values: Tensor, outside: float) -> Tensor:
    return F.pad(values.flatten(), (0, 1), value=outside)


def _best_nearby(values: Tensor, width: int) -> Tensor:
    """The best within a square of an odd width around each place, (side, side)."""
    padded = F.pad(values[None, None], (width // 2,) * 4, value=OUTSIDE)
    return F.max_pool2d(padded, width, stride=1)[0, 0]


def _reachable(physics: Physics, mode_rule: str, spacing: float, helper: int) -> Tensor:
    moves = reaches_of(physics, mode_rule, spacing)[helper].displacements
    moves = moves[(np.abs(moves) <= STEPS).all(axis=1)] + STEPS
    reachable = torch.zeros(REACH, REACH, dtype=torch.bool)
    reachable[moves[:, 0], moves[:, 1]] = True
    return reachable.flatten()
