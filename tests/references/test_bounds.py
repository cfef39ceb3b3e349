"""Upper bounds: above every flight, and near the optimum where it is known."""

import dataclasses

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from hyuav import InputError, Scenario, solve_optimum
from hyuav.physics.slot import Physics
from hyuav.references.bounds import CellBounds
from hyuav.references.rewards import sum_rates

SEEDS = st.integers(0, 2**31)


def without_fading(name: str = "two_clusters", **changes: object) -> Scenario:
    return dataclasses.replace(Scenario.preset(name), fading=False, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "value"), [("random_disk", 60.183), ("two_clusters", 59.080)])
def test_the_bound_of_one_helper_is_within_two_percent_of_the_optimum(
    name: str, value: float
) -> None:
    physics = Physics(without_fading(name), dtype=torch.float64)
    bound = CellBounds(physics, seed=0).of("hybrid", 20)
    assert bound is not None
    assert value < bound < 1.02 * value


@pytest.mark.parametrize("power_control", [False, True])
def test_the_bound_is_above_the_optimum_with_fading(power_control: bool) -> None:
    scenario = dataclasses.replace(
        Scenario.preset("random_disk"),
        num_slots=5,
        power_control=power_control,
        power_range=6.0,
    )
    for optimum in solve_optimum(
        scenario, ["hybrid"], resolution=5.0, power_step=3.0, draws=64, certify=True
    ).values():
        assert optimum.upper_bound is not None
        assert optimum.value < optimum.upper_bound + 4 * optimum.standard_error


@settings(max_examples=20)
@given(SEEDS, st.sampled_from(["hybrid", "relay", "jamming", "rj"]), st.booleans())
def test_no_random_flight_exceeds_the_bound(seed: int, mode_rule: str, colluding: bool) -> None:
    generator = torch.Generator().manual_seed(seed)
    starts = 200 * torch.rand(4, 2, generator=generator, dtype=torch.float64) - 100
    scenario = without_fading(
        helper_starts=starts[:2],
        eavesdropper_positions=starts[2:],
        eavesdroppers="colluding" if colluding else "independent",
        jamming_power=1e-4,
        num_slots=4,
    )
    physics = Physics(scenario, dtype=torch.float64)
    bound = _COARSE(physics).of(mode_rule, 4)
    assert bound is not None
    path, total = starts[:2], 0.0
    for velocity in 40 * torch.rand(4, 2, 2, generator=generator, dtype=torch.float64) - 20:
        path = physics.move(path, velocity).position
        vectors = {"relay": [(True, True)], "jamming": [(False, False)], "rj": [(True, False)]}
        modes = vectors.get(mode_rule, [pair for own in vectors.values() for pair in own])
        total += float(sum_rates(physics, modes, path, (), None, None).max())
    assert total <= bound + 1e-9


class _COARSE(CellBounds):
    """With fewer cells, so that it takes no time."""

    def __init__(self, physics: Physics) -> None:
        super().__init__(physics, seed=0)
        self._count = 8
        self._side = physics.scenario.map_side / 8
        axis = (torch.arange(8, dtype=torch.float64) + 0.5) * self._side - 100.0
        self._centers = torch.cartesian_prod(axis, axis)


def test_the_servers_budget_does_not_lower_the_bound() -> None:
    physics = Physics(without_fading(edge_energy_budget=1.0), dtype=torch.float64)
    free = Physics(without_fading(), dtype=torch.float64)
    assert CellBounds(physics, 0).of("relay", 5) == CellBounds(free, 0).of("relay", 5)


def test_there_is_no_bound_for_several_helpers_whose_power_is_controlled() -> None:
    scenario = without_fading(helper_starts=((0, 0), (0, 0)), power_control=True)
    assert CellBounds(Physics(scenario, dtype=torch.float64), 0).of("hybrid", 5) is None


def test_modes_of_other_helpers_are_refused() -> None:
    with pytest.raises(InputError, match=r"^mode_rules = 'rj'"):
        solve_optimum("two_clusters", ["rj"])
