"""Random UE layouts."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hyuav import InputError, InputTypeError, Scenario
from hyuav.physics.layout import clusters, disk, random_layout

SEEDS = st.integers(0, 2**40)
CENTER = st.tuples(st.floats(-50, 50), st.floats(-50, 50))
LENGTH = st.floats(0.0, 100.0)


def distances(points: Any, center: tuple[float, float]) -> Any:
    return np.linalg.norm(np.array(points) - np.array(center), axis=-1)


@given(st.integers(1, 200), LENGTH, CENTER, SEEDS)
def test_all_ues_lie_in_the_disk(
    num_ues: int, radius: float, center: tuple[float, float], seed: int
) -> None:
    points = disk(num_ues, radius, center, seed=seed)
    assert len(points) == num_ues
    assert distances(points, center).max() <= radius + 1e-9


def test_ues_are_uniform_in_the_disk() -> None:
    points = np.array(disk(50_000, 40.0, (3.0, -7.0), seed=0)) - np.array([3.0, -7.0])
    share = (np.linalg.norm(points, axis=1) / 40.0) ** 2  # of the disk's area within reach
    angle = (np.arctan2(points[:, 1], points[:, 0]) / (2 * math.pi)) % 1.0
    for values in (share, angle):
        quantiles = np.quantile(values, np.linspace(0.05, 0.95, 19))
        np.testing.assert_allclose(quantiles, np.linspace(0.05, 0.95, 19), atol=0.015)
    assert abs(np.corrcoef(share, angle)[0, 1]) < 0.02
    assert len(np.unique(points, axis=0)) == 50_000


@given(st.lists(st.integers(1, 30), min_size=1, max_size=6), LENGTH, LENGTH, CENTER, SEEDS)
def test_clusters_have_their_sizes_radius_and_spread(
    sizes: list[int], radius: float, spread: float, center: tuple[float, float], seed: int
) -> None:
    points = clusters(sizes, radius, spread, center, seed=seed)
    assert len(points) == sum(sizes)
    away = distances(points, center)
    assert away.max() <= spread + radius + 1e-9
    assert away.min() >= spread - radius - 1e-9


@given(st.integers(2, 7), SEEDS)
def test_cluster_centers_are_evenly_spaced_around_the_center(count: int, seed: int) -> None:
    centers = np.array(clusters([1] * count, 0.0, 30.0, (5.0, -5.0), seed=seed))
    np.testing.assert_allclose(distances(centers, (5.0, -5.0)), 30.0)
    gap = np.linalg.norm(centers - np.roll(centers, 1, axis=0), axis=1)
    np.testing.assert_allclose(gap, 2 * 30.0 * math.sin(math.pi / count))


def test_the_clusters_are_turned_at_random() -> None:
    first = np.array([clusters([1, 1], 0.0, 30.0, seed=seed)[0] for seed in range(400)])
    quadrants = (first[:, 0] > 0) * 2 + (first[:, 1] > 0)
    assert np.bincount(quadrants).min() > 70


def test_ues_are_uniform_in_each_cluster() -> None:
    points = np.array(clusters([20_000, 10_000], 15.0, 30.0, seed=1))
    for cluster in (points[:20_000], points[20_000:]):
        away = np.linalg.norm(cluster - cluster.mean(axis=0), axis=1)
        assert np.mean(away**2) == pytest.approx(15.0**2 / 2, rel=0.03)
        assert away.max() <= 15.5


@given(SEEDS)
def test_the_same_seed_draws_the_same_layout(seed: int) -> None:
    assert disk(7, seed=seed) == disk(7, seed=seed)
    assert disk(7, seed=seed) != disk(7, seed=seed + 1)
    assert clusters([3, 4], seed=seed) == clusters([3, 4], seed=seed)
    assert clusters([3, 4], seed=seed) != clusters([3, 4], seed=seed + 1)


def test_a_layout_makes_a_scenario() -> None:
    scenario = Scenario(ue_positions=clusters([7, 3], seed=0))
    assert scenario.num_ues == 10


@pytest.mark.parametrize(
    ("arguments", "error", "field"),
    [
        ({"num_ues": 0}, InputError, "num_ues"),
        ({"num_ues": -3}, InputError, "num_ues"),
        ({"num_ues": 2.5}, InputTypeError, "num_ues"),
        ({"num_ues": "3"}, InputTypeError, "num_ues"),
        ({"num_ues": 3, "radius": -1.0}, InputError, "radius"),
        ({"num_ues": 3, "radius": math.nan}, InputError, "radius"),
        ({"num_ues": 3, "radius": math.inf}, InputError, "radius"),
        ({"num_ues": 3, "radius": "wide"}, InputTypeError, "radius"),
        ({"num_ues": 3, "center": (1.0,)}, InputError, "center"),
        ({"num_ues": 3, "center": (0.0, math.nan)}, InputError, "center"),
        ({"num_ues": 3, "center": 5.0}, InputTypeError, "center"),
        ({"num_ues": 3, "seed": -1}, InputError, "seed"),
        ({"num_ues": 3, "seed": "a"}, InputTypeError, "seed"),
    ],
)
def test_a_disk_that_cannot_be_drawn_is_refused(
    arguments: dict[str, Any], error: type[Exception], field: str
) -> None:
    with pytest.raises(error, match=f"^{field}") as caught:
        disk(**{"seed": 0, **arguments})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "error", "field"),
    [
        ({"sizes": []}, InputError, "sizes"),
        ({"sizes": [3, 0]}, InputError, "sizes"),
        ({"sizes": [3, 1.5]}, InputTypeError, "sizes"),
        ({"sizes": 3}, InputTypeError, "sizes"),
        ({"sizes": [3], "cluster_radius": -1.0}, InputError, "cluster_radius"),
        ({"sizes": [3], "cluster_radius": math.nan}, InputError, "cluster_radius"),
        ({"sizes": [3], "spread": -1.0}, InputError, "spread"),
        ({"sizes": [3], "spread": math.inf}, InputError, "spread"),
        ({"sizes": [3], "center": "origin"}, InputTypeError, "center"),
        ({"sizes": [3], "seed": 1.5}, InputTypeError, "seed"),
    ],
)
def test_clusters_that_cannot_be_drawn_are_refused(
    arguments: dict[str, Any], error: type[Exception], field: str
) -> None:
    with pytest.raises(error, match=f"^{field}") as caught:
        clusters(**{"seed": 0, **arguments})
    assert "\n" not in str(caught.value)


def test_random_layouts_are_disks_and_two_clusters_in_turn() -> None:
    for seed in range(1000, 1040, 2):
        assert random_layout(seed) == disk(10, seed=seed)
        points = random_layout(seed + 1)
        sizes = [n for n in range(3, 8) if points == clusters([n, 10 - n], seed=seed + 1)]
        assert len(sizes) == 1


def test_the_clusters_of_random_layouts_have_all_sizes() -> None:
    first = [np.array(random_layout(seed)) for seed in range(1, 201, 2)]
    near = [(distances(points, points[0]) <= 30.0).sum() for points in first]
    assert set(near) == {3, 4, 5, 6, 7}
    assert min(near.count(size) for size in range(3, 8)) >= 10


def test_a_random_layout_needs_a_seed() -> None:
    with pytest.raises(InputError, match=r"^seed = -1: expected a whole number >= 0"):
        random_layout(-1)
