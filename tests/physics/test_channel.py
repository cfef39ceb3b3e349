"""Distances, path gains and fading, from the paper's equations 3 and 4."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import reference
from hyuav.physics.channel import horizontal_distance, k_factor_from_db, path_gain, rician_power

DTYPES = [torch.float32, torch.float64]
POINT = st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))


def tensor(*values: object) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


@given(POINT, POINT)
def test_the_distance_is_euclidean_and_symmetric(
    a: tuple[float, float], b: tuple[float, float]
) -> None:
    found = float(horizontal_distance(tensor(*a), tensor(*b)))
    assert found == pytest.approx(reference.distance(a, b), rel=1e-12, abs=1e-150)
    assert found == float(horizontal_distance(tensor(*b), tensor(*a)))


def test_distances_broadcast_over_nodes() -> None:
    helpers = torch.tensor([[[0.0, 0.0]], [[3.0, 4.0]]])
    nodes = torch.tensor([[0.0, 0.0], [3.0, 4.0], [-3.0, -4.0]])
    found = horizontal_distance(helpers, nodes)
    assert found.tolist() == [[0.0, 5.0, 5.0], [5.0, 0.0, 10.0]]


@pytest.mark.parametrize(
    ("distance", "height", "reference_gain", "gain"),
    [
        (math.hypot(10, 18), 80.0, 1e-5, 1.465416e-9),
        (math.hypot(30, 58), 80.0, 1e-5, 9.377344e-10),
        (math.hypot(90, 62), 120.0, 1e-5, 3.795931e-10),
        (math.hypot(40, 40), 0.0, 1e-4, 3.125000e-8),
        (math.hypot(120, 120), -40.0, 1e-4, 3.289474e-9),
    ],
)
@pytest.mark.parametrize("dtype", DTYPES)
def test_the_path_gains_of_the_first_ue_of_two_clusters(
    distance: float, height: float, reference_gain: float, gain: float, dtype: torch.dtype
) -> None:
    found = path_gain(torch.tensor(distance, dtype=dtype), height, reference_gain)
    assert found.dtype == dtype
    assert float(found) == pytest.approx(gain, rel=1e-6)


@given(st.floats(0.0, 1e4), st.floats(-300.0, 300.0), st.floats(1e-7, 1.0))
def test_the_path_gain_never_exceeds_that_at_the_reference_distance(
    distance: float, height: float, gain: float
) -> None:
    found = float(path_gain(tensor(distance), height, gain))
    assert 0.0 < found <= gain
    if distance**2 + height**2 >= 1.0:
        assert found == pytest.approx(gain / (height**2 + distance**2))


@pytest.mark.parametrize("distance", [0.0, 1e-30, 0.5, 1.0])
def test_at_the_same_altitude_the_distance_is_at_least_one_metre(distance: float) -> None:
    assert float(path_gain(tensor(distance), 0.0, 1e-4)) == pytest.approx(1e-4)


def test_the_path_gain_falls_with_the_distance() -> None:
    gains = path_gain(torch.linspace(0, 500, 1001, dtype=torch.float64), 80.0, 1e-5)
    assert bool((gains.diff() < 0).all())


def test_the_path_gain_is_differentiable_in_the_distance() -> None:
    distance = torch.tensor([0.5, 3.0, 70.0, 250.0], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda d: path_gain(d, 80.0, 1e3), (distance,))


def test_the_path_gain_is_differentiable_in_the_position() -> None:
    helper = torch.tensor([[3.0, -4.0], [90.0, 20.0]], dtype=torch.float64, requires_grad=True)
    node = tensor(10.0, 18.0)
    assert torch.autograd.gradcheck(
        lambda p: path_gain(horizontal_distance(p, node), 0.0, 1e3), (helper,)
    )


@pytest.mark.parametrize(
    ("decibel", "ratio"), [(12.0, 15.849), (20.0, 100.0), (0.0, 1.0), (-10.0, 0.1)]
)
def test_the_k_factor_in_decibel_is_a_power_ratio(decibel: float, ratio: float) -> None:
    assert k_factor_from_db(decibel) == pytest.approx(ratio, rel=1e-4)


@pytest.mark.parametrize("k_factor", [0.0, 1.0, 15.849, 100.0])
@pytest.mark.parametrize("dtype", DTYPES)
def test_the_fading_power_has_unit_mean_and_rician_moments(
    k_factor: float, dtype: torch.dtype
) -> None:
    draws = rician_power(
        torch.tensor(k_factor, dtype=dtype), (400_000,), torch.Generator().manual_seed(0)
    )
    assert draws.dtype == dtype
    deviation = draws.double() - 1.0
    variance = (1 + 2 * k_factor) / (1 + k_factor) ** 2
    assert float(deviation.mean()) == pytest.approx(0.0, abs=5 * math.sqrt(variance / 400_000))
    assert float(deviation.square().mean()) == pytest.approx(variance, rel=0.02)
    # Of the noncentral chi-squared distribution with two degrees of freedom.
    third = (2 + 6 * k_factor) / (1 + k_factor) ** 3
    assert float(deviation.pow(3).mean()) == pytest.approx(third, rel=0.12)


def test_without_line_of_sight_the_fading_power_is_exponential() -> None:
    draws = rician_power(tensor(0.0), (200_000,), torch.Generator().manual_seed(1))
    for level in (0.1, 0.5, 1.0, 2.0, 4.0):
        assert float((draws > level).double().mean()) == pytest.approx(math.exp(-level), abs=0.005)


def test_each_element_of_the_fading_is_an_independent_draw_with_its_own_k_factor() -> None:
    k_factor = tensor(1.0, 100.0)
    draws = rician_power(k_factor, (50_000, 2), torch.Generator().manual_seed(2))
    assert float(torch.corrcoef(draws.T)[0, 1]) == pytest.approx(0.0, abs=0.02)
    assert draws.var(dim=0).tolist() == pytest.approx([0.75, 201 / 101**2], rel=0.05)


def test_the_generator_decides_the_fading() -> None:
    first, again, other = (
        rician_power(tensor(3.0), (5,), torch.Generator().manual_seed(seed)) for seed in (1, 1, 2)
    )
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
