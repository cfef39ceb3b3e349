"""The random numbers of a slot: the fading of every link, and the UEs' tasks."""

import dataclasses
import math

import pytest
import torch

from hyuav import Scenario
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import draw_tasks


def test_fading_has_unit_mean_and_rician_variance_on_every_link() -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), ground_to_air_k_factor=3.0, air_to_air_k_factor=9.0
    )
    draws = Physics(scenario, dtype=torch.float64).draw_fading(
        (100_000,), torch.Generator().manual_seed(1)
    )
    assert draws is not None
    ground, air = 10**0.3, 10**0.9
    variance = torch.tensor([ground] * 30 + [air] * 2, dtype=torch.float64)
    variance = (1 + 2 * variance) / (1 + variance) ** 2
    assert draws.shape == (100_000, 32)
    torch.testing.assert_close(
        draws.mean(dim=0), torch.ones(32, dtype=torch.float64), rtol=0, atol=0.015
    )
    torch.testing.assert_close(draws.var(dim=0), variance, rtol=0.05, atol=0)


def test_fading_is_independent_from_link_to_link_and_slot_to_slot() -> None:
    physics = Physics(Scenario.preset("two_clusters"), dtype=torch.float64)
    generator = torch.Generator().manual_seed(2)
    first, second = (physics.draw_fading((20_000,), generator) for _ in range(2))
    assert first is not None
    assert second is not None
    correlation = torch.corrcoef(torch.cat([first, second], dim=-1).T)
    correlation.fill_diagonal_(0.0)
    assert float(correlation.abs().max()) < 0.04


def test_fading_can_be_switched_off() -> None:
    physics = Physics(
        dataclasses.replace(Scenario.preset("two_clusters"), fading=False), dtype=torch.float64
    )
    assert physics.draw_fading((3,), torch.Generator()) is None


def test_a_pure_line_of_sight_is_no_fading() -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), ground_to_air_k_factor=100.0, air_to_air_k_factor=100.0
    )
    fading = Physics(scenario, dtype=torch.float64).draw_fading(
        (100,), torch.Generator().manual_seed(0)
    )
    torch.testing.assert_close(fading, torch.ones(100, 32, dtype=torch.float64), rtol=0, atol=1e-4)


@pytest.mark.parametrize(("decibel", "ratio"), [(12.0, 15.849), (20.0, 100.0)])
def test_the_k_factor_is_given_in_decibel(decibel: float, ratio: float) -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), ground_to_air_k_factor=decibel)
    draws = Physics(scenario, dtype=torch.float64).draw_fading(
        (200_000,), torch.Generator().manual_seed(4)
    )
    assert draws is not None
    found = float(draws[:, :30].var())
    assert found == pytest.approx((1 + 2 * ratio) / (1 + ratio) ** 2, rel=0.02)
    assert math.isclose(10 ** (decibel / 10), ratio, rel_tol=1e-4)


def test_tasks_are_uniform_over_their_ranges_and_independent() -> None:
    scenario, generator = Scenario.preset("two_clusters"), torch.Generator().manual_seed(3)
    tasks = draw_tasks(scenario, (40_000,), generator, torch.float64)
    for values, (low, high) in ((tasks.size, (160e3, 240e3)), (tasks.cycles_per_bit, (1e3, 1.2e3))):
        assert values.shape == (40_000, 10)
        assert float(values.min()) >= low
        assert float(values.max()) <= high
        quantiles = torch.quantile(values[:, 0], torch.linspace(0.1, 0.9, 9, dtype=torch.float64))
        expected = low + (high - low) * torch.linspace(0.1, 0.9, 9, dtype=torch.float64)
        torch.testing.assert_close(quantiles, expected, rtol=0, atol=0.02 * (high - low))
    correlation = torch.corrcoef(torch.cat([tasks.size, tasks.cycles_per_bit], dim=-1).T)
    correlation.fill_diagonal_(0.0)
    assert float(correlation.abs().max()) < 0.03
    torch.testing.assert_close(tasks.cpu_cycles, tasks.size * tasks.cycles_per_bit)


def test_a_task_range_of_no_width_is_that_value() -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), task_size=(5.0, 5.0), cycles_per_bit=(7.0, 7.0)
    )
    tasks = draw_tasks(scenario, (50,), torch.Generator().manual_seed(0), torch.float64)
    assert tasks.cpu_cycles.unique().tolist() == [35.0]
