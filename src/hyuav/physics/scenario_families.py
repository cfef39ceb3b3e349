"""Families of scenarios: drawn anew by a seed, with as many users, helpers and rules as they like.

A policy for every layout is trained and judged on these. One has one helper and one eavesdropper
and is else as the paper's table; Two has two helpers, and Many three or four, at places and with
powers at which helpers are needed.
"""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from hyuav._support.errors import require_choice
from hyuav._support.parameters import CountOrZero, checked
from hyuav._support.randomness import derived_seed
from hyuav.physics.layout import in_disk
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.scenario import Point, Scenario

SPLITS = ("training", "validation", "test")
"""Each has scenarios of its own for the same seed."""

_AMPLE: dict[str, Any] = {
    "ue_energy_budget": 1.0,
    "edge_energy_budget": 1e4,
    "helper_energy_budget": 1e6,
}
"""In J: budgets that never bind."""


class Ruled(NamedTuple):
    """A scenario, and who chooses its helpers' modes."""

    scenario: Scenario
    mode_rule: str
    """hybrid, relay or jamming."""


@dataclasses.dataclass(frozen=True)
class ScenarioFamily:
    """The ranges from which a family's scenarios are drawn; lengths in m, powers in W."""

    helpers: tuple[int, int]
    eavesdroppers: tuple[int, int]
    spread: float
    """The farthest center of a cluster from L."""
    contested: bool
    """Whether the jamming power, the coverage, the eavesdroppers' altitude and their kind vary."""

    def draw(self, seed: int) -> Ruled:
        """The scenario of a seed; the same seed draws the same."""
        rng = np.random.default_rng(seed)
        legitimate = rng.uniform(-30.0, 30.0, 2)
        changes: dict[str, Any] = {}
        if self.contested:
            changes = {
                "jamming_power": float(10.0 ** rng.uniform(-5.0, np.log10(0.08))),
                "coverage_radius": float(rng.uniform(45.0, 120.0)),
                "eavesdropper_altitude": float(rng.uniform(80.0, 120.0)),
                "eavesdroppers": ("independent", "colluding")[int(rng.integers(2))],
            }
        scenario = Scenario(
            ue_positions=_points(_users(rng, legitimate, self.spread)),
            legitimate_position=_points(legitimate[None])[0],
            eavesdropper_positions=_anywhere(rng, self.eavesdroppers),
            helper_starts=_anywhere(rng, self.helpers),
            num_slots=int(rng.integers(8, 31)),
            power_control=bool(rng.integers(2)),
            **_AMPLE,
            **changes,
        )
        return Ruled(scenario, MODE_RULES[int(rng.integers(len(MODE_RULES)))])


FAMILIES = {
    "one": ScenarioFamily((1, 1), (1, 1), spread=35.0, contested=False),
    "two": ScenarioFamily((2, 2), (1, 2), spread=100.0, contested=True),
    "many": ScenarioFamily((3, 4), (2, 3), spread=100.0, contested=True),
}
"""By name."""


def family(name: str, seed: int, split: str = "test") -> Ruled:
    """A scenario of a family, and who chooses its helpers' modes.

    Args:
        name: one, two or many.
        seed: of the scenario; the same seed draws the same.
        split: training, validation or test, whose scenarios have nothing to do with each other.

    Raises:
        InputError: an unknown family or split, or a negative seed.

    Example:
        >>> scenario, mode_rule = family("one", 0)
        >>> scenario.num_helpers
        1
    """
    require_choice("family", name, FAMILIES)
    require_choice("split", split, SPLITS)
    seed = checked(CountOrZero, "seed", seed)
    return FAMILIES[name].draw(derived_seed(seed, f"family {name}, {split}"))


def _users(
    rng: np.random.Generator, legitimate: NDArray[np.float64], spread: float
) -> NDArray[np.float64]:
    """4 to 20 users in a disk around L, or in one to three clusters, (U, 2) m on the map."""
    count = int(rng.integers(4, 21))
    if rng.integers(2):
        return legitimate + _in_disk(rng, np.full(count, 45.0))
    clusters = int(rng.integers(1, 4))
    angle, distance = rng.uniform(0.0, 2 * np.pi, clusters), rng.uniform(10.0, spread, clusters)
    centers = legitimate + distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    radii, own = rng.uniform(5.0, 20.0, clusters), np.sort(np.arange(count) % clusters)
    return (centers[own] + _in_disk(rng, radii[own])).clip(-100.0, 100.0)


def _in_disk(rng: np.random.Generator, radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """Uniform in disks of these radii around the origin: (U, 2) m."""
    draws = torch.from_numpy(rng.uniform(size=(2, len(radii)))).mT
    return in_disk(draws, torch.from_numpy(radii), (0.0, 0.0)).numpy()


def _anywhere(rng: np.random.Generator, counts: tuple[int, int]) -> tuple[Point, ...]:
    count = int(rng.integers(counts[0], counts[1] + 1))
    return _points(rng.uniform(-100.0, 100.0, (count, 2)))


def _points(positions: NDArray[np.float64]) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in positions)
