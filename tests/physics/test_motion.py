"""Speed limits and the map."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav.physics.motion import feasible_velocity, move

AXIS = st.floats(-3.0, 3.0)


def velocity_of(action: tuple[float, float], limit: float | None) -> list[float]:
    norm_limit = None if limit is None else torch.tensor([limit], dtype=torch.float64)
    found: list[float] = feasible_velocity(
        torch.tensor(action, dtype=torch.float64), 20.0, norm_limit
    ).tolist()
    return found


@given(AXIS, AXIS)
def test_without_a_norm_limit_each_component_is_bounded_on_its_own(ax: float, ay: float) -> None:
    expected = [20.0 * min(max(a, -1.0), 1.0) for a in (ax, ay)]
    assert velocity_of((ax, ay), None) == pytest.approx(expected)


@given(AXIS, AXIS, st.floats(0.0, 40.0))
def test_a_norm_limit_shortens_the_velocity_and_keeps_its_direction(
    ax: float, ay: float, limit: float
) -> None:
    wish = [20.0 * min(max(a, -1.0), 1.0) for a in (ax, ay)]
    found = velocity_of((ax, ay), limit)
    assert math.hypot(*found) == pytest.approx(min(math.hypot(*wish), limit), abs=1e-12)
    assert found[0] * wish[1] == pytest.approx(found[1] * wish[0], abs=1e-9)
    assert found[0] * wish[0] + found[1] * wish[1] >= 0.0


@pytest.mark.parametrize("limit", [None, 0.0, 5.0])
def test_a_helper_told_to_hover_hovers(limit: float | None) -> None:
    assert velocity_of((0.0, 0.0), limit) == [0.0, 0.0]


def test_each_row_may_have_its_own_norm_limit() -> None:
    action = torch.ones(3, 2, 2)
    limit = torch.tensor([[[5.0]], [[10.0]], [[100.0]]])
    speeds = feasible_velocity(action, 20.0, limit).norm(dim=-1)
    expected = torch.tensor([5.0, 10.0, 20.0 * math.sqrt(2)])[:, None].expand(3, 2)
    torch.testing.assert_close(speeds, expected)


@given(
    st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)),
    st.tuples(st.floats(-90.0, 90.0), st.floats(-90.0, 90.0)),
    st.floats(0.1, 3.0),
)
def test_a_flight_ends_on_the_map_or_where_it_began(
    start: tuple[float, float], velocity: tuple[float, float], duration: float
) -> None:
    position = torch.tensor(start, dtype=torch.float64)
    flown = move(position, torch.tensor(velocity, dtype=torch.float64), duration, 200.0)
    target = [p + v * duration for p, v in zip(start, velocity, strict=True)]
    leaves = max(abs(c) for c in target) > 100.0
    assert bool(flown.off_map) == leaves
    assert flown.position.tolist() == pytest.approx(list(start) if leaves else target)
    assert flown.velocity.tolist() == list(velocity)


def test_each_row_leaves_the_map_or_stays_on_its_own() -> None:
    position = torch.tensor([[[95.0, 0.0], [0.0, 0.0]], [[0.0, -95.0], [-95.0, 0.0]]])
    velocity = torch.tensor([10.0, -10.0])
    flown = move(position, velocity, 1.0, 200.0)
    assert flown.off_map.tolist() == [[True, False], [True, False]]
    assert flown.position.tolist() == [[[95.0, 0.0], [10.0, -10.0]], [[0.0, -95.0], [-85.0, -10.0]]]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("map_side", [200.0, 0.2, 333.3, 1e-3])
def test_hovering_in_the_corner_of_the_map_is_not_leaving_it(
    map_side: float, dtype: torch.dtype
) -> None:
    corner = torch.tensor([map_side / 2, -map_side / 2], dtype=dtype)
    flown = move(corner, torch.zeros(2, dtype=dtype), 1.0, map_side)
    assert not bool(flown.off_map)


def test_the_position_is_differentiable_in_the_action() -> None:
    start = torch.tensor([3.0, 4.0], dtype=torch.float64)
    action = torch.tensor([0.7, -0.9], dtype=torch.float64, requires_grad=True)
    for limit in (None, torch.tensor([15.0], dtype=torch.float64)):
        assert torch.autograd.gradcheck(
            lambda a, limit=limit: move(start, feasible_velocity(a, 20.0, limit), 1.0, 200.0)[0],
            (action,),
        )
