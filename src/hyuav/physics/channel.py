"""Distances, channel power gains and fading of all links: the paper's equations 3 and 4.

All functions take tensors with any leading batch shape (written ``...``), in float32 or float64.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple, Self

import torch
from torch import Tensor

from hyuav.physics.scenario import Scenario

REFERENCE_DISTANCE = 1.0
"""d_0 in metres: the distance at which the reference gains beta_0 and beta_1 are received."""


class Links(NamedTuple):
    """One number for each link of a slot: channel power gains, or fading powers.

    U is the number of UEs, H of helpers, E of eavesdroppers.
    """

    ue_legitimate: Tensor
    """(..., U), g_{u,L}."""
    ue_helper: Tensor
    """(..., U, H), g_{u,H}."""
    ue_eavesdropper: Tensor
    """(..., U, E), g_{u,E}."""
    helper_legitimate: Tensor
    """(..., H), g_{H,L}."""
    helper_eavesdropper: Tensor
    """(..., H, E), g_{H,E}."""
    helper_helper: Tensor
    """(..., H (H - 1) / 2), the same in both directions, in the order of :func:`pairs`."""

    def faded(self, fading: "Links | None") -> "Links":
        """These path gains times the fading powers; as they are where fading is off."""
        if fading is None:
            return self
        return Links(*map(torch.mul, self, fading))

    def to_legitimate(self, helper: int) -> Tensor:
        """The number of a helper's link to the legitimate UAV, (..., 1)."""
        alone = self.helper_legitimate.shape[-1] == 1
        return self.helper_legitimate if alone else self.helper_legitimate.narrow(-1, helper, 1)

    def to_eavesdroppers(self, helper: int) -> Tensor:
        """The numbers of a helper's links to the eavesdroppers, (..., E)."""
        return self.helper_eavesdropper.select(-2, helper)

    def to_helper(self, helper: int, other: int) -> Tensor:
        """The number of the link between two helpers, (..., 1)."""
        pair = min(helper, other), max(helper, other)
        number = pairs(self.helper_legitimate.shape[-1]).index(pair)
        return self.helper_helper.narrow(-1, number, 1)


@dataclass(frozen=True)
class LinkRow:
    """How the numbers of all links lie in one row: in the order of :class:`Links`.

    Random numbers are drawn and stored in rows (..., size).
    """

    num_ues: int
    num_helpers: int
    num_eavesdroppers: int

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The row of a scenario's links."""
        return cls(scenario.num_ues, scenario.num_helpers, scenario.num_eavesdroppers)

    @cached_property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """The shape of each entry of :class:`Links`, without leading axes."""
        ues, helpers, eavesdroppers = self.num_ues, self.num_helpers, self.num_eavesdroppers
        from_ues = (ues,), (ues, helpers), (ues, eavesdroppers)
        return (*from_ues, (helpers,), (helpers, eavesdroppers), (len(pairs(helpers)),))

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """How many links of each kind there are."""
        return tuple(math.prod(shape) for shape in self.shapes)

    @property
    def size(self) -> int:
        """How many links there are."""
        return sum(self.counts)

    def flatten(self, links: Links) -> Tensor:
        """All numbers in one row: (..., size)."""
        rows = zip(links, self.shapes, strict=True)
        return torch.cat([values.flatten(-len(shape)) for values, shape in rows], dim=-1)

    def unflatten(self, row: Tensor) -> Links:
        """The numbers of a row (..., size) by link; they share its memory."""
        parts = zip(row.split_with_sizes(self.counts, dim=-1), self.shapes, strict=True)
        return Links(
            *(
                part if len(shape) == 1 else torch.unflatten(part, -1, shape)
                for part, shape in parts
            )
        )


def pairs(num_helpers: int) -> list[tuple[int, int]]:
    """All pairs of helpers (i, j) with i < j, counted from 0."""
    return list(combinations(range(num_helpers), 2))


def horizontal_distance(position: Tensor, other: Tensor) -> Tensor:
    """Euclidean distance on the ground plane, D (m).

    Args:
        position: (..., 2) m.
        other: (..., 2) m, broadcast against ``position``.

    Returns:
        (...) m.
    """
    distance: Tensor = torch.linalg.vector_norm(position - other, dim=-1)
    return distance


def path_gain(
    distance: Tensor, height_difference: float, reference_gain: float, exponent: float = 2.0
) -> Tensor:
    """Path power gain beta / (h^2 + D^2)^(alpha / 2): the first factor of eq. 3 and of eq. 4.

    The squared distance is clamped below by d_0^2, so that the gain stays finite where the
    helper flies straight above another UAV at its own altitude.

    Args:
        distance: (...) horizontal distance in m.
        height_difference: in m.
        reference_gain: beta_0 or beta_1, the gain at d_0.
        exponent: alpha; 2 in free space, as in the paper.

    Returns:
        (...) dimensionless.
    """
    squared = distance.square()
    if height_difference:
        squared = squared + height_difference**2
    if abs(height_difference) < REFERENCE_DISTANCE:
        squared = squared.clamp(min=REFERENCE_DISTANCE**2)
    loss = squared if exponent == 2.0 else squared.pow(exponent / 2)
    return loss.reciprocal() * reference_gain


def ground_to_air(scenario: Scenario, distance: Tensor, height_difference: float) -> Tensor:
    """Path gain of a UE's link to a UAV (eq. 3 without fading); as :func:`path_gain`."""
    gain, exponent = scenario.ground_to_air_gain, scenario.ground_to_air_exponent
    return path_gain(distance, height_difference, gain, exponent)


def air_to_air(scenario: Scenario, distance: Tensor, height_difference: float) -> Tensor:
    """Path gain of a helper's link to another UAV (eq. 4 without fading); as :func:`path_gain`."""
    return path_gain(distance, height_difference, scenario.air_to_air_gain)


def k_factor_from_db(k_factor_db: float) -> float:
    """The Rician K-factor as a power ratio."""
    return float(10.0 ** (k_factor_db / 10.0))


class RicianFading(NamedTuple):
    r"""The law of the fading power \|gamma\|^2 (text below eq. 3), which has unit mean.

    gamma = sqrt(K / (K + 1)) + sqrt(1 / (K + 1)) n with n circularly symmetric complex
    Gaussian of unit variance. An equation multiplies a power gain by gamma, so it is the
    squared magnitude that enters.
    """

    line_of_sight: Tensor
    """K / (K + 1): (...) power of the direct path."""
    scatter: Tensor
    """1 / (K + 1): (...) mean power of the scattered paths."""
    cross: Tensor
    """(...) twice the product of both amplitudes."""

    @classmethod
    def of(cls, k_factor: Tensor) -> "RicianFading":
        """The law for K as a power ratio (...)."""
        line_of_sight, scatter = k_factor / (k_factor + 1.0), 1.0 / (k_factor + 1.0)
        return cls(line_of_sight, scatter, 2.0 * (line_of_sight * scatter).sqrt())

    def power(self, level: Tensor, angle: Tensor) -> Tensor:
        """The power of a draw, with n = sqrt(-ln(level)) e^(j angle) (Box and Muller, 1958).

        Args:
            level: uniform in (0, 1].
            angle: uniform over a full turn, in rad.

        Returns:
            the shape to which these and K broadcast, dimensionless.
        """
        scattered = -level.log()
        return (
            self.line_of_sight
            + self.scatter * scattered
            + (self.cross * scattered.sqrt() * angle.cos())
        )


def rician_power(
    k_factor: Tensor, shape: tuple[int, ...], generator: torch.Generator | None = None
) -> Tensor:
    """Draw fading powers of the law :class:`RicianFading`.

    Args:
        k_factor: K as a power ratio, broadcast against ``shape``; fixes dtype and device.
        shape: of the result; each element is an independent draw.
        generator: of the random numbers, on the device of ``k_factor``.

    Returns:
        ``shape``, dimensionless.
    """
    level, turn = torch.rand(
        (2, *shape), generator=generator, dtype=k_factor.dtype, device=k_factor.device
    )
    return RicianFading.of(k_factor).power(1.0 - level, 2.0 * math.pi * turn)
