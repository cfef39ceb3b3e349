"""Upper bounds: above every flight, and near the optimum where it is known."""

import dataclasses

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from hyuav import InputError, Scenario, solve_optimum
from hyuav.physics.modes import mode_vectors
from hyuav.physics.slot import Physics
from hyuav.references.bounds import CellBounds
from hyuav.references.rewards import sum_rates

SEEDS = st.integers(0, 2**31)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer cells, so that it takes no time."""
    monkeypatch.setattr("hyuav.references.bounds.FIRST_CELLS", 6**4)
    monkeypatch.setattr("hyuav.references.bounds.MORE_CELLS", 2**11)


def without_fading(name: str = "two_clusters", **changes: object) -> Scenario:
    return dataclasses.replace(Scenario.preset(name), fading=False, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "value"), [("random_disk", 60.183), ("two_clusters", 59.080)])
def test_the_bound_of_one_helper_is_within_two_percent_of_the_optimum(
    name: str, value: float
) -> None:
    physics = Physics(without_fading(name), dtype=torch.float64)
    bound = CellBounds(physics, seed=0).of("hybrid", 20)
    assert value < bound < 1.02 * value


@pytest.mark.usefixtures("small")
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


@pytest.mark.usefixtures("small")
@settings(max_examples=10)
@given(SEEDS, st.sampled_from(["hybrid", "relay", "jamming", "rj"]), st.booleans(), st.booleans())
def test_no_random_flight_exceeds_the_bound(
    seed: int, mode_rule: str, colluding: bool, power_control: bool
) -> None:
    generator = torch.Generator().manual_seed(seed)
    starts = 200 * torch.rand(4, 2, generator=generator, dtype=torch.float64) - 100
    scenario = without_fading(
        helper_starts=starts[:2],
        eavesdropper_positions=starts[2:],
        eavesdroppers="colluding" if colluding else "independent",
        jamming_power=1e-4,
        power_control=power_control,
        power_range=20.0,
        num_slots=4,
    )
    physics = Physics(scenario, dtype=torch.float64)
    fixed = {"relay": [(True, True)], "jamming": [(False, False)], "rj": [(True, False)]}
    modes = fixed.get(mode_rule, mode_vectors(2))
    earned = []
    for _ in range(2):
        path, total = starts[:2], 0.0
        for velocity in 40 * torch.rand(4, 2, 2, generator=generator, dtype=torch.float64) - 20:
            path = physics.move(path, velocity).position
            power = 10 ** (-2 * torch.rand(2, generator=generator, dtype=torch.float64))
            power = power if power_control else torch.ones_like(power)
            total += float(sum_rates(physics, modes, path, (), None, None, power).max())
        earned.append(total)
    bounds = CellBounds(physics, seed=0)
    known, other = earned
    # The known flight decides where cells are cut; the other one is bounded none the less.
    assert max(earned) <= bounds.of(mode_rule, 4, known) + 1e-9
    assert other <= bounds.of(mode_rule, 4, known) + 1e-9


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("power_control", [False, True])
def test_a_known_flight_lowers_the_bound_no_further_than_to_itself(power_control: bool) -> None:
    scenario = without_fading("contested", power_control=power_control)
    physics = Physics(scenario, dtype=torch.float64)
    bounds = CellBounds(physics, seed=0)
    rough = bounds.of("jamming", 10, 1e9)
    half = bounds.of("jamming", 10, rough / 2)
    fine = bounds.of("jamming", 10)
    assert 183.64 < fine <= half < rough  # as by solve_optimum(..., resolution=2.0)


@pytest.mark.parametrize(("name", "value"), [("contested", 398.393), ("two_eavesdroppers", 35.101)])
def test_the_bound_of_two_helpers_is_within_a_tenth_of_a_flight(name: str, value: float) -> None:
    physics = Physics(without_fading(name), dtype=torch.float64)
    assert value < CellBounds(physics, seed=0).of("hybrid", 20, value) < 1.1 * value


@pytest.mark.usefixtures("small")
def test_the_servers_budget_does_not_lower_the_bound() -> None:
    physics = Physics(without_fading(edge_energy_budget=1.0), dtype=torch.float64)
    free = Physics(without_fading(), dtype=torch.float64)
    assert CellBounds(physics, 0).of("relay", 5) == CellBounds(free, 0).of("relay", 5)


def test_modes_of_other_helpers_are_refused() -> None:
    with pytest.raises(InputError, match=r"^mode_rules = 'rj'"):
        solve_optimum("two_clusters", ["rj"])
