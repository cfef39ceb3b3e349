"""What computing, transmitting and flying cost."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav.physics import energy


def test_the_worst_local_execution_fits_the_budget_of_a_ue() -> None:
    worst = energy.computation_energy(torch.tensor(240e3 * 1200.0), 1e-27, 1.0)
    assert float(worst) == pytest.approx(23.89e-3, abs=5e-6)
    assert float(worst) <= 0.025


def test_the_worst_load_fits_the_budget_of_the_edge() -> None:
    worst = energy.computation_energy(torch.tensor(10 * 240e3 * 1200.0), 1e-27, 1.0)
    assert float(worst) == pytest.approx(23.89, abs=5e-3)
    assert float(worst) <= 24.0


def test_with_1024_bytes_in_a_kilobyte_local_execution_would_exceed_its_budget() -> None:
    worst = energy.computation_energy(torch.tensor(30 * 1024 * 8 * 1200.0), 1e-27, 1.0)
    assert float(worst) > 0.025


def test_the_fastest_flight_and_jamming_fit_the_budget_of_the_helper() -> None:
    flight = float(energy.flight_energy(torch.tensor([20.0, -20.0]), 9.65, 1.0))
    assert flight == pytest.approx(3860.0)
    assert flight + energy.jamming_energy(0.08, 1.0) == pytest.approx(3860.08)


@given(st.floats(1.0, 1e12), st.floats(-32.0, -20.0), st.floats(0.1, 10.0))
def test_computing_costs_the_cube_of_the_frequency(
    frequency: float, exponent: float, duration: float
) -> None:
    capacitance = 10.0**exponent
    expected = capacitance * frequency**3 * duration
    for dtype, tolerance in ((torch.float64, 1e-12), (torch.float32, 1e-5)):
        found = energy.computation_energy(
            torch.tensor(frequency, dtype=dtype), capacitance, duration
        )
        assert found.dtype == dtype
        if expected > 1e-30:
            assert float(found) == pytest.approx(expected, rel=tolerance)


def test_the_load_of_a_hundred_thousand_ues_does_not_overflow_single_precision() -> None:
    load = torch.tensor(1e5 * 240e3 * 1200.0, dtype=torch.float32)
    assert float(energy.computation_energy(load, 1e-27, 1.0)) == pytest.approx(
        2.388787e13, rel=1e-5
    )


@pytest.mark.parametrize(("num_ues", "duration"), [(1, 1.0), (10, 1.0), (4, 0.5)])
def test_a_ue_sends_for_its_share_of_the_slot_and_for_half_of_it_to_a_relay(
    num_ues: int, duration: float
) -> None:
    whole = energy.offloading_energy(0.1, duration, num_ues, relay=False)
    half = energy.offloading_energy(0.1, duration, num_ues, relay=True)
    assert whole == pytest.approx(0.1 * duration / num_ues)
    assert half == pytest.approx(whole / 2)


def test_relaying_costs_half_a_share_of_the_slot_for_each_ue_that_sends_through_a_helper() -> None:
    found = energy.relay_energy(torch.tensor([[3, 0], [0, 4]]), 0.012, 2.0 / 4)
    expected = torch.tensor([[3 * 0.012 * 2 / 8, 0.0], [0.0, 0.012]])
    torch.testing.assert_close(found, expected)


def test_jamming_lasts_the_whole_slot() -> None:
    assert energy.jamming_energy(0.08, 2.5) == pytest.approx(0.2)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.1, 50.0), st.floats(0.1, 5.0))
def test_flying_costs_the_square_of_the_speed(
    vx: float, vy: float, mass: float, duration: float
) -> None:
    velocity = torch.tensor([vx, vy], dtype=torch.float64)
    found = float(energy.flight_energy(velocity, mass, duration))
    assert found == pytest.approx(0.5 * mass * duration * (vx**2 + vy**2))


@given(st.floats(0.0, 1e5), st.floats(0.1, 50.0), st.floats(0.1, 5.0))
def test_the_speed_within_a_budget_spends_exactly_that_budget(
    budget: float, mass: float, duration: float
) -> None:
    speed = energy.speed_within_budget(budget, mass, duration)
    velocity = torch.tensor([0.6 * speed, -0.8 * speed], dtype=torch.float64)
    assert float(energy.flight_energy(velocity, mass, duration)) == pytest.approx(budget)


def test_a_negative_budget_leaves_no_speed() -> None:
    assert energy.speed_within_budget(-1.0, 9.65, 1.0) == 0.0
