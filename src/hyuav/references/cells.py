"""What helpers earn at most in a slot, each anywhere in a cell of the map.

The reward is bounded by the reward with each link as good as it can be from anywhere in the cells:
a relay is as near to L and its UEs as possible and as far from the eavesdroppers, a jammer the
other way round. Powers lie in intervals: where one helps it is the largest, where it harms the
least.
"""

from collections.abc import Iterator, Sequence
from functools import reduce
from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics import channel, rates
from hyuav.physics.channel import Links, pairs
from hyuav.physics.energy import ue_can_pay
from hyuav.physics.offloading import covered
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics

_CHUNK = 2**14
"""Cells and draws computed at once: the rates of some UEs fit the cache."""

_FACTORS = 8
"""UEs whose ratios are multiplied before a logarithm is taken, so few that none overflows."""


class Cells(NamedTuple):
    """Where helpers may be and what they may send at: P cells of all H helpers."""

    centers: Tensor
    """Of the squares where they are, (P, H, 2) m."""
    side: Tensor
    """Of these squares, (P,) m."""
    power: Tensor
    """The largest, (P, H) dB over the nominal power."""
    width: Tensor
    """How far below that a power may be, (P,) dB."""

    @classmethod
    def over(cls, scenario: Scenario, count: int, levels: int) -> "Cells":
        """All of the map, by so many along a side, and of powers, by so many intervals."""
        helpers, side = scenario.num_helpers, scenario.map_side / count
        along = (torch.arange(count, dtype=torch.float64, device="cpu") + 0.5) * side
        squares = _all([along - scenario.map_side / 2] * (2 * helpers))
        width = scenario.power_range / levels if scenario.power_control else 0.0
        powers = _all([torch.arange(levels, dtype=torch.float64, device="cpu") * -width] * helpers)
        return cls(
            squares.repeat_interleave(len(powers), dim=0).unflatten(-1, (helpers, 2)),
            squares.new_full((len(squares) * len(powers),), side),
            powers.repeat(len(squares), 1),
            squares.new_full((len(squares) * len(powers),), width),
        )

    def split(self, size: int) -> Iterator["Cells"]:
        """So many at a time."""
        return map(Cells._make, zip(*(each.split(size) for each in self), strict=True))

    def taken(self, index: Tensor) -> "Cells":
        """Those of these numbers, or where it is true."""
        return Cells(*(each[index] for each in self))

    def and_more(self, others: "Cells") -> "Cells":
        """These, and others behind them."""
        return Cells(*map(torch.cat, zip(self, others, strict=True)))

    @property
    def halves(self) -> int:
        """Into how many parts each is cut."""
        helpers = self.power.shape[1]
        return 2 ** (3 * helpers if bool(self.width.any()) else 2 * helpers)

    def halved(self) -> "Cells":
        """Each cut in two along all axes, those of power too where it is controlled."""
        helpers, parts = self.power.shape[1], self.halves
        bits = torch.arange(parts, device="cpu").unsqueeze(-1) >> torch.arange(
            3 * helpers, device="cpu"
        )
        upper = (bits & 1).to(torch.float64).repeat(len(self.side), 1)
        each = Cells(*(values.repeat_interleave(parts, dim=0) for values in self))
        side, width = each.side / 2, each.width / 2
        shift = (upper[:, : 2 * helpers] - 0.5).unflatten(-1, (helpers, 2))
        return Cells(
            each.centers + side.reshape(-1, 1, 1) * shift,
            side,
            each.power - width.unsqueeze(-1) * upper[:, 2 * helpers :],
            width,
        )


class CellRewards:
    """Bounds of the expected reward of a slot.

    They hold up to the draws over which fading is averaged. The budget E_L of the edge server is
    not kept, which bounds what is earned with it.

    Args:
        physics: of the scenario, in float64.
        fading: draws that are averaged over, (draws, ...); None for no fading.
    """

    def __init__(self, physics: Physics, fading: Links | None) -> None:
        self._physics, self._standing = physics, physics.standing(physics.nodes)
        self._draws = 1 if fading is None else len(fading.ue_legitimate)
        self._fading = None if fading is None else _last(fading, -1)
        relayed = self._standing.covered & ue_can_pay(physics.scenario, relay=True)
        self._relayed, self._straight = (
            allowed.reshape(-1, 1, 1) for allowed in (relayed, self._standing.may_send)
        )

    def cost(self, vectors: Sequence[Sequence[bool]]) -> int:
        """How many rates of a UE a bound takes, by ways in each of the modes and draws."""
        # A UE has a way through each relay, and straight where a helper jams.
        return self._draws * sum(sum(relays) + (not all(relays)) for relays in vectors)

    def __call__(self, cells: Cells, vectors: Sequence[Sequence[bool]]) -> Tensor:
        """The bounds of given cells: (P,) bps/Hz.

        Args:
            cells: of the helpers.
            vectors: the modes that may be chosen.
        """
        bounds = []
        for part in cells.split(max(_CHUNK // self._draws, 1)):
            received = self._received(part)
            sums = [self._sum_rate(received, relays) for relays in vectors]
            bounds.append(reduce(torch.maximum, sums).mean(dim=0))
        return torch.cat(bounds)

    def _received(self, cells: Cells) -> "_Received":
        scenario, positions = self._physics.scenario, self._standing.positions
        first, second = ([pair[end] for pair in pairs(scenario.num_helpers)] for end in (0, 1))
        centers, side = cells.centers, cells.side.reshape(-1, 1, 1)
        nearest, farthest = _span(centers.unsqueeze(-2), positions, side.unsqueeze(-1) / 2)
        # Two cells are apart as one of twice the side and a point.
        close, apart = _span(centers[:, first], centers[:, second], side)
        most = torch.pow(10.0, cells.power / 10.0)
        least = torch.pow(10.0, (cells.power - cells.width.unsqueeze(-1)) / 10.0)
        to_ues = self._physics.by_role(nearest)[0].permute(2, 1, 0).unsqueeze(-2)
        return _Received(
            self._gains(nearest, close, most),
            self._gains(farthest, apart, least),
            least.mT.unsqueeze(1),
            covered(to_ues, scenario.coverage_radius) & self._relayed.unsqueeze(1),
        )

    def _gains(self, distances: Tensor, between: Tensor, power: Tensor) -> Links:
        scenario, standing = self._physics.scenario, self._standing
        to_ues, to_legitimate, to_eavesdroppers = self._physics.by_role(distances)
        climb = scenario.altitude - scenario.eavesdropper_altitude
        gains = Links(
            standing.legitimate_gain.unsqueeze(0),
            channel.ground_to_air(scenario, to_ues.mT, scenario.altitude),
            standing.eavesdropper_gain.unsqueeze(0),
            channel.air_to_air(scenario, to_legitimate.squeeze(-1), 0.0) * power,
            channel.air_to_air(scenario, to_eavesdroppers, climb) * power.unsqueeze(-1),
            channel.air_to_air(scenario, between, 0.0),
        )
        return _last(gains, -2).faded(self._fading)

    def _sum_rate(self, received: "_Received", relays: Sequence[bool]) -> Tensor:
        """The largest sum-rate in given modes: (draws, P) bps/Hz."""
        scenario, (most, least, quietest, near) = self._physics.scenario, received
        ue, relaying, jamming = (
            power / scenario.noise_power
            for power in (scenario.ue_power, scenario.relay_power, scenario.jamming_power)
        )
        jammers = [helper for helper, relay in enumerate(relays) if not relay]
        quiet = 1.0 / _noise(least.helper_legitimate[jammers] * jamming)
        loud = 1.0 / _noise(most.helper_eavesdropper[jammers] * jamming)
        legitimate, heard = most.ue_legitimate * ue, most.ue_eavesdropper * ue
        ways = []
        if jammers:
            ratio = self._ratio(legitimate * quiet, heard * loud)
            ways.append(ratio.square_().mul_(self._straight))
        for helper, relay in enumerate(relays):
            if relay:
                numbers = [pairs(len(relays)).index(_ordered(helper, own)) for own in jammers]
                jammed = least.helper_helper[numbers] * quietest[jammers] * jamming
                combined = (most.helper_legitimate[helper] * relaying + legitimate) * quiet
                decoded = most.ue_helper[:, helper] * (ue / _noise(jammed))
                overheard = (least.helper_eavesdropper[helper] * relaying + heard) * loud
                ratio = self._ratio(torch.minimum(combined, decoded), overheard)
                ways.append(ratio.mul_(near[:, helper]))
        best = reduce(torch.maximum, ways)
        best.masked_fill_(best <= 4.0**scenario.min_secrecy_rate, 1.0)
        groups = [ues.prod(dim=0).log2() for ues in best.split(_FACTORS)]
        return reduce(torch.add, groups) / 2.0

    def _ratio(self, snr: Tensor, heard: Tensor) -> Tensor:
        """2 to the power of the secrecy rate of a UE while it sends: (U, draws, P)."""
        overheard = rates.overheard(heard.movedim(1, -1), self._physics.scenario.eavesdroppers)
        return (snr + 1.0).div_(overheard + 1.0)


class _Received(NamedTuple):
    """What the best and the worst places and powers make of all links."""

    most: Links
    """Gains (..., draws, P), those of a helper and another node times the helper's power."""
    least: Links
    """Likewise."""
    quietest: Tensor
    """The least powers, (H, 1, P) in units of the nominal power."""
    near: Tensor
    """Which UEs a helper may relay, (U, H, 1, P) bool."""


def _all(axes: Sequence[Tensor]) -> Tensor:
    """All combinations of numbers of some axes: (N, axes)."""
    return torch.cartesian_prod(*axes).reshape(-1, len(axes))


def _noise(jamming: Tensor) -> Tensor:
    """In units of sigma^2, with what the jammers add (J, ...): (...)."""
    return jamming.sum(dim=0) + 1.0


def _ordered(one: int, other: int) -> tuple[int, int]:
    return min(one, other), max(one, other)


def _last(links: Links, place: int) -> Links:
    """The first axis, of draws or of cells, at one of the last two, the other one of length 1."""
    moved = (values.movedim(0, -1).contiguous().unsqueeze(place) for values in links)
    return Links(*moved)


def _span(centers: Tensor, others: Tensor, half: Tensor) -> tuple[Tensor, Tensor]:
    """The least and the largest distance from squares of these half sides to points, in m."""
    away = (centers - others).abs()
    nearest = torch.linalg.vector_norm((away - half).clamp(min=0.0), dim=-1)
    return nearest, torch.linalg.vector_norm(away + half, dim=-1)
