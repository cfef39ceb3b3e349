"""The energy budgets of UEs, edge server and helper: ample in the paper, kept where they bind."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import worlds
from hyuav import Scenario, SecureOffloadingEnv
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.outcome import Control
from hyuav.physics.slot import Physics, slot
from reference import assert_same, changed, fly, place, start_at

TWO_CLUSTERS = Scenario.preset("two_clusters")
RANDOM_DISK = Scenario.preset("random_disk")
SEEDS = st.integers(0, 2**31)

# Far beyond anything a slot can spend.
UNLIMITED = {
    "ue_energy_budget": 1e30,
    "edge_energy_budget": 1e30,
    "helper_energy_budget": 1e30,
}


@given(
    st.sampled_from([TWO_CLUSTERS, RANDOM_DISK]),
    st.sampled_from(MODE_RULES),
    st.lists(worlds.coordinates(100.0), min_size=8, max_size=8),
    st.booleans(),
    SEEDS,
)
def test_no_energy_budget_binds_with_the_papers_parameters(
    scenario: Scenario,
    scheme: str,
    start: list[tuple[float, float]],
    diagnostics: bool,
    seed: int,
) -> None:
    flights = []
    generator = torch.Generator().manual_seed(seed)
    actions = (2.4 * torch.rand(4, 8, 2, generator=generator) - 1.2).clamp(-1, 1)
    for world in (scenario, changed(scenario, **UNLIMITED)):
        env = SecureOffloadingEnv(world, scheme, 8, seed=seed, diagnostics=diagnostics)
        states = [start_at(env, start)]
        for action in actions:
            states.append(fly(env, states[-1], action))
        flights.append(states)
    for limited, unlimited in zip(*flights, strict=True):
        assert_same(limited, unlimited)
        if diagnostics:
            assert not limited["diagnostics", "budget_violation"].any()


def test_the_papers_budgets_hold_in_the_worst_slot_there_can_be() -> None:
    # Largest tasks, jamming for ten offloading UEs above E, diagonal flight at full speed.
    scenario = changed(
        RANDOM_DISK, fading=False, task_size=(240e3, 240e3), cycles_per_bit=(1200.0, 1200.0)
    )
    env = SecureOffloadingEnv(scenario, "jamming", diagnostics=True, seed=0)
    first = fly(env, start_at(env, [60.0, 60.0]), [1.0, 1.0])
    second = fly(env, first, [-1.0, 1.0])
    assert int(first["diagnostics", "offloading"].sum()) == 10
    assert float(second["diagnostics", "helper_energy"]) == pytest.approx(3860.08, abs=1e-3)
    assert float(second["diagnostics", "edge_energy"]) == pytest.approx(23.89, abs=5e-3)
    assert not second["diagnostics", "budget_violation"].any()
    far = fly(env, start_at(env, [-60.0, -60.0]), [0.0, 0.0])
    assert not far["diagnostics", "offloading"].any()
    assert far["diagnostics", "ue_energy"].tolist() == pytest.approx([23.89e-3] * 10, abs=5e-6)
    assert not far["diagnostics", "budget_violation"].any()


def above_e(scenario: Scenario, scheme: str = "hybrid") -> tuple[SecureOffloadingEnv, Any]:
    """At (80, 80) without fading: all ten UEs of random_disk offload while the helper jams."""
    world = changed(scenario, fading=False)
    env = SecureOffloadingEnv(world, scheme, diagnostics=True, seed=1)
    return env, start_at(env, [80.0, 80.0])


def test_nobody_offloads_where_sending_exceeds_the_budget_of_a_ue() -> None:
    env, state = above_e(changed(RANDOM_DISK, ue_energy_budget=0.0099))
    state = fly(env, state, [0.0, 0.0])
    assert not state["diagnostics", "offloading"].any()
    assert float(state["reward"]) == 0.0
    # Local execution takes at least 4 mJ; above 9.9 mJ it cannot be avoided, only counted.
    above = state["diagnostics", "ue_energy"] > 0.0099
    assert above.any()
    assert not above.all()
    assert int(state["diagnostics", "budget_violation"]) == int(above.sum())


def test_the_relay_mode_is_affordable_at_half_the_budget_of_jamming() -> None:
    scenario = changed(TWO_CLUSTERS, fading=False, ue_energy_budget=0.006)
    env = SecureOffloadingEnv(scenario, diagnostics=True, seed=0)
    relaying = fly(env, start_at(env, [-49.0, 6.0]), [0.0, 0.0])
    assert float(relaying["reward"]) == pytest.approx(2.391039, rel=1e-5)
    sending = relaying["diagnostics", "ue_energy"][relaying["diagnostics", "offloading"]]
    assert sending.tolist() == pytest.approx([0.005] * 7)
    assert not fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])["reward"].any()


@pytest.mark.parametrize("budget", [0.05, 1.0, 3.0, 6.0])
def test_a_small_edge_budget_admits_the_best_and_is_kept_in_the_next_slot(budget: float) -> None:
    env, state = above_e(changed(RANDOM_DISK, edge_energy_budget=budget))
    nodes = env.physics.nodes._replace(helper=state["position"])
    free = Physics(changed(env.scenario, edge_energy_budget=1e30))
    rates = slot(free, nodes, Control(torch.zeros(1, 2))).jamming.secrecy_rate
    for _ in range(10):
        state = fly(env, state, [0.0, 0.0])
        details = state["diagnostics"]
        admitted = details["offloading"]
        assert 0 < int(admitted.sum()) < 10
        assert rates[admitted].min() > rates[~admitted].max()
        assert float(state["reward"]) == pytest.approx(float(rates[admitted].sum()), rel=1e-5)
        assert float(details["edge_energy"]) <= budget
        assert int(details["budget_violation"]) == 0


def test_an_edge_without_energy_admits_nobody() -> None:
    env, state = above_e(changed(RANDOM_DISK, edge_energy_budget=0.0))
    state = fly(env, state, [0.0, 0.0])
    assert not state["diagnostics", "offloading"].any()
    assert float(state["reward"]) == 0.0


def test_the_edge_computes_in_a_slot_what_it_took_in_the_previous_one() -> None:
    env, state = above_e(RANDOM_DISK)
    first = fly(env, state, [0.0, 0.0])
    assert float(first["diagnostics", "edge_energy"]) == 0.0
    second = fly(env, first, [0.0, 0.0])
    load = float(first["diagnostics", "edge_load"])
    assert float(second["diagnostics", "edge_energy"]) == pytest.approx(1e-27 * load**3)


@given(
    st.floats(0.1, 3000.0),
    st.sampled_from(["box", "disc"]),
    st.sampled_from(MODE_RULES),
    worlds.actions(),
)
def test_a_small_flight_budget_shortens_the_velocity_and_keeps_its_direction(
    budget: float, speed_limit: str, scheme: str, action: tuple[float, float]
) -> None:
    scenario = changed(TWO_CLUSTERS, helper_energy_budget=budget, speed_limit=speed_limit)
    env = SecureOffloadingEnv(scenario, scheme, diagnostics=True, seed=0)
    state = fly(env, start_at(env, [0.0, 0.0]), action)
    assert float(state["diagnostics", "helper_energy"]) <= budget * (1 + 1e-5)
    assert not state["diagnostics", "budget_violation"].any()
    flown = place(state).double().numpy()
    wish = np.clip(action, -1.0, 1.0)
    assert flown[0] * wish[1] == pytest.approx(flown[1] * wish[0], abs=1e-4)
    assert float(flown @ wish) >= 0.0
    energy = 0.5 * 9.65 * float((20.0 * wish) @ (20.0 * wish))
    spent = 0.5 * 9.65 * float(flown @ flown)
    if energy > budget:
        left = budget - (0.006 if scheme == "relay" else 0.08)
        most = 1930.0 if speed_limit == "disc" else 3860.0
        assert spent == pytest.approx(min(left, most), rel=1e-4)


def test_a_budget_below_the_jamming_energy_is_counted_as_exceeded() -> None:
    scenario = changed(TWO_CLUSTERS, helper_energy_budget=0.05)
    env = SecureOffloadingEnv(scenario, "jamming", diagnostics=True, seed=0)
    state = fly(env, start_at(env, [10.0, 0.0]), [1.0, 1.0])
    assert place(state).tolist() == [10.0, 0.0]
    assert float(state["diagnostics", "helper_energy"]) == pytest.approx(0.08)
    assert int(state["diagnostics", "budget_violation"]) == 1


@pytest.mark.parametrize("size", [123456.0, 160e3, 177777.7, 199999.9, 240e3])
def test_budgets_that_are_met_exactly_are_not_exceeded(size: float) -> None:
    # One UE whose task never varies; every budget is what the slot spends.
    cycles = size * 1011.0
    local = 1e-27 * cycles**3
    world = changed(
        RANDOM_DISK,
        ue_positions=[(23.0, 13.0)],
        fading=False,
        task_size=(size, size),
        cycles_per_bit=(1011.0, 1011.0),
        ue_power=local,
        ue_energy_budget=local * (1 + 1e-9),
        edge_energy_budget=local * (1 + 1e-9),
        helper_energy_budget=0.5 * 9.65 * 2 * 20.0**2 + 0.08,
        min_secrecy_rate=0.0,
    )
    env = SecureOffloadingEnv(world, "jamming", diagnostics=True, seed=0)
    state = start_at(env, [60.0, 60.0])
    for action in ([1.0, 1.0], [0.0, 0.0]):
        state = fly(env, state, action)
        assert state["diagnostics", "offloading"].all()
        assert not state["diagnostics", "budget_violation"].any()
    at_home = fly(env, start_at(env, [-60.0, -60.0]), [0.0, 0.0])
    assert not at_home["diagnostics", "offloading"].any()
    assert not at_home["diagnostics", "budget_violation"].any()


@pytest.mark.parametrize("size", [123456.0, 160e3, 177777.7, 199999.9, 240e3])
def test_asking_for_diagnostics_admits_the_same_ues_where_the_edge_budget_just_suffices(
    size: float,
) -> None:
    cycles = 10 * size * 1011.0
    world = changed(
        RANDOM_DISK,
        fading=False,
        task_size=(size, size),
        cycles_per_bit=(1011.0, 1011.0),
        edge_energy_budget=1e-27 * cycles**3 * (1 + 1e-12),
        ue_energy_budget=1.0,
    )
    rewards = []
    for diagnostics in (False, True):
        env = SecureOffloadingEnv(world, diagnostics=diagnostics, seed=0)
        rewards.append(float(fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])["reward"]))
    assert rewards[0] == rewards[1]
