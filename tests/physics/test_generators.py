"""Layouts drawn from uniform numbers."""

import dataclasses
import math
import warnings

import numpy as np
import pytest
import torch

from hyuav import (
    ClustersLayout,
    DiskLayout,
    InputError,
    LayoutFamily,
    RandomLayout,
    Scenario,
    ScenarioWarning,
    make_env,
)
from hyuav.physics.generators import LayoutGenerator, over_horizon


def draws(count: int, size: int) -> torch.Tensor:
    return torch.rand(count, size, generator=torch.Generator().manual_seed(0))


def test_ues_are_uniform_in_the_disk() -> None:
    layout = DiskLayout(20, 40.0, (3.0, -7.0))
    ues = layout.place(draws(2000, layout.size)).reshape(-1, 2).numpy() - np.array([3.0, -7.0])
    share = (np.linalg.norm(ues, axis=1) / 40.0) ** 2  # of the disk's area within reach
    angle = (np.arctan2(ues[:, 1], ues[:, 0]) / (2 * math.pi)) % 1.0
    for values in (share, angle):
        quantiles = np.quantile(values, np.linspace(0.05, 0.95, 19))
        np.testing.assert_allclose(quantiles, np.linspace(0.05, 0.95, 19), atol=0.015)
    assert abs(np.corrcoef(share, angle)[0, 1]) < 0.02


def test_clusters_lie_evenly_around_a_circle_that_is_turned_at_random() -> None:
    layout = ClustersLayout(sizes=(2, 1, 3), cluster_radius=0.0, spread=30.0, center=(5.0, 6.0))
    ues = layout.place(draws(4000, layout.size)) - torch.tensor([5.0, 6.0])
    torch.testing.assert_close(ues.norm(dim=-1), torch.full((4000, 6), 30.0))
    angle = torch.atan2(ues[..., 1], ues[..., 0]) / (2 * math.pi)
    steps = (angle - angle[:, :1]).remainder(1.0).mul(3).round().remainder(3)
    assert steps.unique(dim=0).tolist() == [[0.0, 0.0, 1.0, 2.0, 2.0, 2.0]]
    quantiles = np.quantile((angle[:, 0] % 1.0).numpy(), np.linspace(0.05, 0.95, 19))
    np.testing.assert_allclose(quantiles, np.linspace(0.05, 0.95, 19), atol=0.03)


def test_ues_lie_around_the_centers_of_their_clusters() -> None:
    layout = ClustersLayout(num_ues=8, num_clusters=2, cluster_radius=10.0)
    ues = layout.place(draws(500, layout.size)).unflatten(1, (2, 4))
    within = (ues - ues.mean(dim=2, keepdim=True)).norm(dim=-1)
    assert float(within.max()) <= 20.0
    assert float((ues[:, 0].mean(dim=1) - ues[:, 1].mean(dim=1)).norm(dim=-1).min()) > 30.0


def test_random_layouts_are_disks_and_two_clusters_of_all_sizes() -> None:
    layout = RandomLayout()
    ues = layout.place(draws(2000, layout.size))
    assert float(ues.norm(dim=-1).max()) <= 45.0
    near = (ues - ues[:, :1]).norm(dim=-1) <= 30.0
    in_order = near.long().diff(dim=1).clamp(min=0).sum(dim=1) == 0  # the first cluster, the rest
    clustered = near[(ues.norm(dim=-1) >= 15.0 - 1e-4).all(dim=1) & in_order]
    sizes = clustered.sum(dim=1).bincount(minlength=11)
    assert bool((sizes[3:8] > 100).all())
    assert 800 < len(clustered) < 1200


def test_a_family_has_the_constants_of_its_scenario() -> None:
    scenario = dataclasses.replace(Scenario.preset("random_disk"), jamming_power=0.3, num_slots=7)
    family = LayoutFamily(DiskLayout(num_ues=4), scenario)
    assert isinstance(family, LayoutGenerator)
    assert family.scenario.num_ues == 4
    example = family.scenario.ue_positions
    assert family.scenario == dataclasses.replace(scenario, ue_positions=example)
    longer = over_horizon(family, 9)
    assert isinstance(longer, LayoutGenerator)
    assert longer.scenario == dataclasses.replace(family.scenario, num_slots=9)
    numbers = draws(3, family.size)
    assert torch.equal(longer.draw(numbers).ue, family.draw(numbers).ue)


def test_a_family_that_does_not_fit_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r"^radius = 120\.0: expected center"):
        LayoutFamily(DiskLayout(radius=120.0))
    with pytest.raises(InputError, match=r"^layout = 'disk': expected a layout such as DiskLayout"):
        LayoutFamily("disk")  # type: ignore[arg-type]


def test_of_a_family_no_layouts_coverage_is_foretold() -> None:
    scenario = dataclasses.replace(Scenario.preset("random_disk"), coverage_radius=1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScenarioWarning)
        make_env(LayoutFamily(DiskLayout(num_ues=5), scenario))
