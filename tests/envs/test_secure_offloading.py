"""One slot of the environment: compared to scalar loops, and the paper's mode rule and flight."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

import reference
import worlds
from hyuav import Scenario, SecureOffloadingEnv
from hyuav.physics.modes import MODE_RULES
from reference import assert_same, changed, fly, next_draws, place, start_at

TWO_CLUSTERS = Scenario.preset("two_clusters")
RANDOM_DISK = Scenario.preset("random_disk")
SEEDS = st.integers(0, 2**31)
ROWS = 4


@given(worlds.scenarios(), st.data(), SEEDS)
def test_every_slot_is_that_of_scalar_loops(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    schemes = data.draw(st.lists(st.sampled_from(MODE_RULES), min_size=ROWS, max_size=ROWS))
    start = data.draw(st.lists(worlds.helpers(scenario), min_size=ROWS, max_size=ROWS))
    env = SecureOffloadingEnv(scenario, schemes, (ROWS,), seed=seed, diagnostics=True)
    powers, cycles = next_draws(env)
    state = start_at(env, start)
    edge_load = [0.0] * ROWS
    for row in range(ROWS):
        helper = reference.as_list(place(state)[row])
        slot = reference.slot(scenario, schemes[row], helper, powers[row], cycles[row])
        assume(slot.margin > 1e-4)
        assert state["mode"][row].tolist() == list(slot.modes)
    for _ in range(3):
        action = data.draw(st.lists(worlds.actions(), min_size=ROWS, max_size=ROWS))
        before = [reference.as_list(position) for position in place(state)]
        powers, cycles = next_draws(env)
        state = fly(env, state, action)
        for row in range(ROWS):
            flight = reference.flight(scenario, schemes[row], before[row], action[row])
            slot = reference.slot(scenario, schemes[row], flight.position, powers[row], cycles[row])
            assume(flight.margin > 1e-5)
            assume(slot.margin > 1e-4)
            compare(scenario, state[row], flight, slot, edge_load[row])
            edge_load[row] = slot.edge_load


def compare(
    scenario: Scenario,
    found: Any,
    flight: reference.Flight,
    slot: reference.Slot,
    load_before: float,
) -> None:
    details = found["diagnostics"]
    expected_rate = np.where(slot.chosen.offloading, slot.chosen.secrecy_rate, 0.0)
    edge_energy = reference.computation_energy(scenario, load_before)
    helper_energy = flight.energy + slot.transmission_energy[0]
    length: dict[str, Any] = {"rel": 1e-5, "abs": 1e-6 * scenario.map_side}
    rate: dict[str, Any] = {"rel": 1e-4, "abs": 2e-4}
    assert found["off_map"].item() == flight.off_map
    assert place(found).tolist() == pytest.approx(flight.position, **length)
    assert found["distances"][0].tolist() == pytest.approx(
        reference.distances(scenario, flight.position), **length
    )
    assert found["mode"].tolist() == list(slot.modes)
    assert found["reward"].item() == pytest.approx(slot.chosen.sum_rate, **rate)
    assert details["offloading"].tolist() == slot.chosen.offloading
    assert details["secrecy_rate"].tolist() == pytest.approx(expected_rate.tolist(), **rate)
    assert details["relay_sum_rate"].item() == pytest.approx(slot.relay.sum_rate, **rate)
    assert details["jamming_sum_rate"].item() == pytest.approx(slot.jamming.sum_rate, **rate)
    assert details["ue_energy"].tolist() == pytest.approx(slot.ue_energy, rel=1e-4)
    assert details["edge_load"].item() == pytest.approx(slot.edge_load, rel=1e-5)
    assert details["edge_energy"].item() == pytest.approx(edge_energy, rel=1e-4)
    assert details["helper_energy"].item() == pytest.approx(helper_energy, rel=1e-4)
    assert details["budget_violation"].item() == reference.violations(
        scenario, slot.ue_energy, edge_energy, [helper_energy]
    )


def test_where_nobody_can_offload_a_tie_jams() -> None:
    env = SecureOffloadingEnv(changed(TWO_CLUSTERS, fading=False), diagnostics=True, seed=0)
    state = fly(env, start_at(env, [-60.0, -60.0]), [0.0, 0.0])
    assert float(state["diagnostics", "relay_sum_rate"]) == 0.0
    assert float(state["diagnostics", "jamming_sum_rate"]) == 0.0
    assert int(state["mode"]) == 0


@pytest.mark.parametrize(
    ("helper", "mode"), [((-20.0, -20.0), 1), ((100.0, 100.0), 0), ((80.0, 80.0), 0)]
)
def test_the_hybrid_helper_takes_the_better_mode(helper: tuple[float, float], mode: int) -> None:
    env = SecureOffloadingEnv(changed(RANDOM_DISK, fading=False), diagnostics=True, seed=0)
    after_reset = start_at(env, helper)
    assert int(after_reset["mode"]) == mode
    state = fly(env, after_reset, [0.0, 0.0])
    assert int(state["mode"]) == mode
    better = max(state["diagnostics", name] for name in ("relay_sum_rate", "jamming_sum_rate"))
    assert float(state["reward"]) == float(better) > 0


@given(SEEDS, st.sampled_from(["relay", "jamming"]))
def test_a_fixed_mode_is_kept_in_every_slot_and_earns_the_rate_of_that_mode(
    seed: int, scheme: str
) -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, scheme, 16, seed=seed, diagnostics=True)
    position = 200 * torch.rand(16, 2, generator=torch.Generator().manual_seed(seed)) - 100
    state = start_at(env, position)
    assert bool((state["mode"] == (scheme == "relay")).all())
    state = fly(env, state, [0.3, -0.2])
    assert bool((state["mode"] == (scheme == "relay")).all())
    assert torch.equal(state["reward"], state["diagnostics", f"{scheme}_sum_rate"])


def test_one_fading_draw_serves_both_modes() -> None:
    # Where a slot relays and where it jams, C_1 and C_0 are those of one and the same draw.
    env = SecureOffloadingEnv(RANDOM_DISK, batch_size=64, seed=3, diagnostics=True)
    position = 40 * torch.rand(64, 2, generator=torch.Generator().manual_seed(0)) + 40
    position[::2] -= 90
    state = start_at(env, position)
    powers, cycles = next_draws(env)
    state = fly(env, state, [0.0, 0.0])
    modes = state["mode"].flatten().tolist()
    assert 0 < sum(modes) < 64
    for row in range(64):
        slot = reference.slot(
            RANDOM_DISK, "hybrid", position[row].tolist(), powers[row], cycles[row]
        )
        if slot.margin > 1e-4:
            found = state["diagnostics"][row]
            assert float(found["relay_sum_rate"]) == pytest.approx(slot.relay.sum_rate, abs=1e-4)
            assert float(found["jamming_sum_rate"]) == pytest.approx(
                slot.jamming.sum_rate, abs=1e-4
            )


def test_every_slot_brings_new_fading() -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, "jamming", seed=0)
    state = start_at(env, [80.0, 80.0])
    rewards = set()
    for _ in range(20):
        state = fly(env, state, [0.0, 0.0])
        rewards.add(float(state["reward"]))
    assert len(rewards) == 20


def test_without_fading_the_reward_depends_on_the_position_alone() -> None:
    env = SecureOffloadingEnv(changed(RANDOM_DISK, fading=False), "jamming", 5, seed=0)
    state = start_at(env, [[80.0, 80.0]] * 5)
    rewards = torch.cat([fly(env, state, [0.0, 0.0])["reward"] for _ in range(4)])
    assert rewards.unique().numel() == 1


@pytest.mark.parametrize(
    ("start", "action"),
    [
        ([100.0, 0.0], [0.5, 0.0]),
        ([-100.0, 3.0], [-0.01, 0.0]),
        ([5.0, 95.0], [0.2, 0.5]),
        ([0.0, -90.0], [1.0, -1.0]),
        ([99.0, 99.0], [1.0, 1.0]),
    ],
)
def test_a_flight_off_the_map_ends_where_it_began(start: list[float], action: list[float]) -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, seed=0, diagnostics=True)
    state = fly(env, start_at(env, start), action)
    assert place(state).tolist() == start
    assert bool(state["off_map"])
    # The attempt costs energy all the same.
    wish = 20.0 * np.array(action)
    flight = 0.5 * 9.65 * float(wish @ wish)
    assert float(state["diagnostics", "helper_energy"]) == pytest.approx(flight + 0.08, abs=0.08)
    back = fly(env, state, [-a for a in action])
    assert not back["off_map"].any()


def test_the_edge_of_the_map_belongs_to_it() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, seed=0)
    state = fly(env, start_at(env, [80.0, -80.0]), [1.0, -1.0])
    assert place(state).tolist() == [100.0, -100.0]
    assert not state["off_map"].any()


@pytest.mark.parametrize(
    ("speed_limit", "action", "step"),
    [
        ("box", [1.0, 1.0], [20.0, 20.0]),
        ("box", [1.0, -0.5], [20.0, -10.0]),
        ("disc", [1.0, 1.0], [14.142136, 14.142136]),
        ("disc", [0.0, -1.0], [0.0, -20.0]),
        ("disc", [0.6, 0.8], [12.0, 16.0]),
        ("disc", [1.0, -0.5], [17.888544, -8.944272]),
        ("box", [7.0, -0.1], [20.0, -2.0]),
        ("box", [0.0, 0.0], [0.0, 0.0]),
        ("disc", [0.0, 0.0], [0.0, 0.0]),
    ],
)
def test_the_speed_limit_bounds_each_component_or_the_norm(
    speed_limit: str, action: list[float], step: list[float]
) -> None:
    env = SecureOffloadingEnv(changed(TWO_CLUSTERS, speed_limit=speed_limit), seed=0)
    state = fly(env, start_at(env, [1.0, 2.0]), action)
    assert place(state).tolist() == pytest.approx([1.0 + step[0], 2.0 + step[1]])


def test_a_slot_twice_as_long_carries_twice_as_far() -> None:
    env = SecureOffloadingEnv(
        changed(TWO_CLUSTERS, slot_duration=2.0, helper_energy_budget=1e9), seed=0
    )
    state = fly(env, start_at(env, [0.0, 0.0]), [0.5, -1.0])
    assert place(state).tolist() == pytest.approx([20.0, -40.0])


def test_each_row_of_the_batch_may_fly_its_own_scheme() -> None:
    scenario = changed(RANDOM_DISK, fading=False, helper_energy_budget=1000.0, jamming_power=600.0)
    env = SecureOffloadingEnv(scenario, MODE_RULES, (3, 2), seed=0, diagnostics=True)
    position = torch.tensor([[-20.0, -20.0], [20.0, 20.0]]).expand(3, 2, 2)
    mixed = fly(env, start_at(env, position), [1.0, 1.0])
    assert mixed["mode"][1].tolist() == [[1], [1]]
    assert mixed["mode"][2].tolist() == [[0], [0]]
    for row, scheme in enumerate(MODE_RULES):
        alone = SecureOffloadingEnv(scenario, scheme, 2, seed=0, diagnostics=True)
        expected = fly(alone, start_at(alone, position[row]), [1.0, 1.0])
        for key in ("position", "mode", "reward"):
            torch.testing.assert_close(mixed[key][row], expected[key])
    # Only the relay need not set jamming energy aside, so it flies farther.
    steps = (place(mixed) - position).norm(dim=-1)
    assert bool((steps[1] > steps[0] + 1.0).all())
    assert torch.equal(steps[0], steps[2])


@pytest.mark.parametrize("fading", [True, False])
def test_each_row_of_the_batch_may_fly_over_its_own_layout(fading: bool) -> None:
    first = changed(RANDOM_DISK, fading=fading, helper_starts=(60.0, 60.0))
    moved = {"legitimate_position": (5.0, -5.0), "eavesdropper_positions": (70.0, 90.0)}
    layouts = [first, changed(TWO_CLUSTERS, fading=fading, helper_starts=(-40.0, 0.0), **moved)]
    actions = 2 * torch.rand(5, 2, 3, 1, 2, generator=torch.Generator().manual_seed(0)) - 1
    together = SecureOffloadingEnv(layouts, ["hybrid", "relay"], (2, 3), seed=[4, 9])
    states = [together.reset()]
    for action in actions:
        states.append(together.step(states[-1].clone().set("action", action))["next"])
    assert together.scenarios == tuple(layouts)
    for row, scheme in enumerate(["hybrid", "relay"]):
        alone = SecureOffloadingEnv(layouts[row], scheme, (1, 3), seed=[4, 9][row : row + 1])
        state = alone.reset()
        for slot, found in enumerate(states):
            assert_same(found[row].exclude("action"), state[0].exclude("action"))
            if slot < len(actions):
                state = alone.step(state.set("action", actions[slot, row : row + 1]))["next"]
