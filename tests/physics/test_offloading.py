"""Coverage, the offloading decision and the edge server's admission."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav.physics import offloading

INSIDE, EDGE, OUTSIDE = 10.0, 45.0, 45.001


def test_a_ue_on_the_edge_of_the_coverage_is_covered() -> None:
    distances = torch.tensor([INSIDE, EDGE, OUTSIDE])
    assert offloading.covered(distances, 45.0).tolist() == [True, True, False]


def test_a_ue_offloads_where_it_is_allowed_and_its_secrecy_rate_exceeds_the_limit() -> None:
    rate = torch.tensor([0.5, 0.5, 0.1, 0.05, 0.0])
    allowed = torch.tensor([True, False, True, True, True])
    assert offloading.offloading_decision(rate, allowed, 0.1).tolist() == [True] + [False] * 4


def test_without_a_limit_any_positive_secrecy_rate_suffices() -> None:
    rate = torch.tensor([1e-6, 0.0])
    allowed = torch.tensor([True, True])
    assert offloading.offloading_decision(rate, allowed, 0.0).tolist() == [True, False]


def admit(wants: list[bool], rates: list[float], cycles: list[float], budget: float) -> list[bool]:
    # With kappa = Delta = 1 the energy is the cube of the load.
    admitted = offloading.admitted_by_edge(
        torch.tensor(wants),
        torch.tensor(rates, dtype=torch.float64),
        torch.tensor(cycles, dtype=torch.float64),
        1.0,
        1.0,
        budget,
    )
    found: list[bool] = admitted.tolist()
    return found


@pytest.mark.parametrize(
    ("wants", "rates", "cycles", "load", "admitted"),
    [
        # The best first, whatever the order of the UEs.
        ([True] * 3, [1.0, 3.0, 2.0], [1.0, 1.0, 1.0], 2.5, [False, True, True]),
        ([True] * 3, [1.0, 3.0, 2.0], [1.0, 1.0, 1.0], 3.5, [True, True, True]),
        ([True] * 3, [1.0, 3.0, 2.0], [1.0, 1.0, 1.0], 0.5, [False, False, False]),
        # One that wants no offloading takes no room.
        ([True, False, True], [1.0, 3.0, 2.0], [1.0, 9.0, 1.0], 2.5, [True, False, True]),
        # Admission ends with the first that does not fit, even if a smaller one would.
        ([True] * 3, [1.0, 3.0, 2.0], [0.1, 1.0, 5.0], 2.5, [False, True, False]),
        # Equal rates keep the order of the UEs.
        ([True] * 3, [2.0, 2.0, 2.0], [1.0, 1.0, 1.0], 2.5, [True, True, False]),
        ([False] * 3, [2.0, 2.0, 2.0], [1.0, 1.0, 1.0], 2.5, [False, False, False]),
        # An exactly met budget is kept.
        ([True] * 2, [2.0, 1.0], [1.0, 1.0], 2.0, [True, True]),
    ],
)
def test_the_edge_admits_the_best_first_while_its_energy_lasts(
    wants: list[bool],
    rates: list[float],
    cycles: list[float],
    load: float,
    admitted: list[bool],
) -> None:
    assert admit(wants, rates, cycles, load**3) == admitted


@given(
    st.lists(
        st.tuples(st.booleans(), st.floats(0.0, 10.0), st.floats(0.0, 10.0)),
        min_size=1,
        max_size=20,
    ),
    st.floats(0.0, 1e5),
)
def test_admission_keeps_the_budget_and_leaves_no_room_for_the_next_in_line(
    ues: list[tuple[bool, float, float]], budget: float
) -> None:
    wants, rates, cycles = (list(column) for column in zip(*ues, strict=True))
    admitted = admit(wants, rates, cycles, budget)
    load = sum(ue[2] for ue, z in zip(ues, admitted, strict=True) if z)
    assert load**3 <= budget * (1 + 1e-12)
    waiting = [ue for ue, z in zip(ues, admitted, strict=True) if ue[0] and not z]
    assert all(ue[0] for ue, z in zip(ues, admitted, strict=True) if z)
    if waiting:
        best_rate = max(rate for _, rate, _ in waiting)
        assert all(ue[1] >= best_rate for ue, z in zip(ues, admitted, strict=True) if z)
        first = next(cycle for _, rate, cycle in waiting if rate == best_rate)
        assert (load + first) ** 3 > budget * (1 - 1e-12)


def test_admission_is_decided_row_by_row() -> None:
    wants = torch.ones(2, 2, 2, dtype=torch.bool)
    rates = torch.tensor([[[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [3.0, 4.0]]])
    cycles = torch.tensor([[[1.0, 1.0], [1.0, 1.0]], [[0.4, 0.4], [9.0, 9.0]]])
    admitted = offloading.admitted_by_edge(wants, rates, cycles, 1.0, 1.0, 1.0)
    assert admitted.tolist() == [
        [[False, True], [True, False]],
        [[True, True], [False, False]],
    ]
