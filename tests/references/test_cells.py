"""Rewards in cells: what a slot earns where a cell is a point, and no less where it is not."""

import dataclasses

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav import Scenario
from hyuav.physics.modes import allowed_vectors, mode_vectors
from hyuav.physics.slot import Physics
from hyuav.references.cells import CellRewards, Cells
from hyuav.references.rewards import stratified_fading, sum_rates

SEEDS = st.integers(0, 2**31)


@pytest.mark.parametrize("mode_rule", ["hybrid", "relay", "jamming", "rj"])
@pytest.mark.parametrize("eavesdroppers", ["independent", "colluding"])
def test_the_bound_of_points_is_what_a_slot_earns(mode_rule: str, eavesdroppers: str) -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_eavesdroppers"),
        eavesdroppers=eavesdroppers,
        jamming_power=1e-4,
        power_control=True,
    )
    physics = Physics(scenario, dtype=torch.float64)
    fading = stratified_fading(physics, 3, torch.Generator().manual_seed(0))
    generator = torch.Generator().manual_seed(1)
    places = 160 * torch.rand(50, 2, 2, generator=generator, dtype=torch.float64) - 80
    power = -20 * torch.rand(50, 2, generator=generator, dtype=torch.float64)
    nothing = torch.zeros(50, dtype=torch.float64)
    points = Cells(places, nothing, power, nothing)
    vectors = allowed_vectors(mode_rule, 2)
    found = CellRewards(physics, fading)(points, vectors)
    sums = sum_rates(
        physics,
        vectors,
        places.unsqueeze(1),
        (50, 3),
        fading,
        None,
        10 ** (power / 10).unsqueeze(1),
    )
    torch.testing.assert_close(found, sums.amax(dim=0).mean(dim=-1))
    assert float(found.max()) > 0.0


@given(SEEDS)
def test_parts_of_a_cell_cover_it_and_bound_no_more(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    physics = Physics(
        dataclasses.replace(Scenario.preset("two_eavesdroppers"), power_control=True),
        dtype=torch.float64,
    )
    number = torch.randint(16 * 3**4, (1,), generator=generator)
    cell = Cells.over(physics.scenario, 3, 4).taken(number)
    halves = cell.halved()
    assert len(halves.side) == cell.halves == 64
    assert len(torch.unique(halves.centers.flatten(1), dim=0)) == 16
    torch.testing.assert_close(halves.centers.mean(dim=0, keepdim=True), cell.centers)
    lowest = (halves.power - halves.width.unsqueeze(-1)).amin(dim=0)
    torch.testing.assert_close(lowest, (cell.power - cell.width)[0])
    assert torch.equal(halves.power.amax(dim=0), cell.power[0])
    bounded = CellRewards(physics, None)
    vectors = mode_vectors(2)
    assert bool((bounded(halves, vectors) <= bounded(cell, vectors) + 1e-9).all())
