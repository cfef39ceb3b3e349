"""What a learner sees and does, as one row of numbers each."""

import dataclasses

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import reference
import worlds
from hyuav import InputError, Scenario, make_env
from hyuav.envs.observation import ObservationLayout
from reference import fly, place, start_at

TWO_CLUSTERS = Scenario.preset("two_clusters")
SEEDS = st.integers(0, 2**31)


@given(worlds.scenarios(), st.data(), SEEDS)
def test_the_observation_is_the_state_normalized_to_order_one(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    env = make_env(scenario, batch_size=3, seed=seed)
    points = data.draw(st.lists(worlds.helpers(scenario), min_size=3, max_size=3))
    state = start_at(env, points)
    half = scenario.map_side / 2
    for _ in range(2):
        assert state["observation"].shape == (3, scenario.num_ues + 5)
        assert state["observation"].dtype == torch.float32
        for row in range(3):
            x, y = reference.as_list(place(state)[row])
            mode = int(state["mode"][row])
            lengths = reference.distances(scenario, (x, y))
            expected = [x / half, y / half, 2 * mode - 1, *(d / half - 1 for d in lengths)]
            assert state["observation"][row].tolist() == pytest.approx(expected, abs=1e-5)
        assert float(state["observation"].abs().max()) <= 3.0
        state = fly(env, state, [0.4, -0.7])


@pytest.mark.parametrize("corner", [(100, 100), (-100, 100), (100, -100), (-100, -100)])
def test_the_observation_is_of_order_one_in_the_corners_of_the_map(
    corner: tuple[int, int],
) -> None:
    # Every node in the opposite corner: no distance on the map is longer.
    opposite = (-corner[0], -corner[1])
    scenario = Scenario(
        ue_positions=(opposite,), legitimate_position=opposite, eavesdropper_positions=(opposite,)
    )
    observation = start_at(make_env(scenario), corner)["observation"]
    assert observation[3:].tolist() == pytest.approx([2 * 2**0.5 - 1] * 3)
    assert float(observation.abs().max()) <= 3.0


def test_a_clock_is_one_more_entry_from_minus_one_to_one() -> None:
    scenario = dataclasses.replace(TWO_CLUSTERS, num_slots=4)
    with_clock, without = (make_env(scenario, seed=0, clock=clock) for clock in (True, False))
    torch.manual_seed(0)
    timed = with_clock.rollout(10)
    torch.manual_seed(0)
    timeless = without.rollout(10)
    assert timed["observation"].shape == (4, 16)
    assert timed["observation"][:, -1].tolist() == pytest.approx([-1.0, -0.5, 0.0, 0.5])
    assert timed["next", "observation"][:, -1].tolist() == pytest.approx([-0.5, 0.0, 0.5, 1.0])
    torch.testing.assert_close(timed["observation"][:, :-1], timeless["observation"])


@pytest.mark.parametrize("clock", [False, True])
def test_the_layout_says_where_everything_stands_in_an_observation(clock: bool) -> None:
    env = make_env(TWO_CLUSTERS, batch_size=4, seed=0, clock=clock)
    layout = ObservationLayout(TWO_CLUSTERS, clock=clock)
    state = fly(env, env.reset(), [0.5, 1.0])
    observation = state["observation"]
    assert observation.shape == (4, layout.size)
    assert torch.equal(layout.position(observation), place(state) / 100.0)
    distances = state["distances"].flatten(-2) / 100.0 - 1.0
    torch.testing.assert_close(layout.distances(observation), distances)
    if clock:
        assert layout.clock(observation).flatten().tolist() == pytest.approx([-0.9] * 4)


def test_an_action_is_flat_and_of_one_shape() -> None:
    env = make_env(TWO_CLUSTERS, batch_size=2, seed=0)
    assert env.action_spec.shape == (2, ObservationLayout(TWO_CLUSTERS, clock=False).action_size)
    flown = env.step(env.reset().set("action", torch.ones(2, 2)))
    assert flown["action"].shape == (2, 2)
    with pytest.raises(InputError, match=r"^action = \(2, 1, 2\): expected shape \(2, 2\)$"):
        env.step(env.reset().set("action", torch.ones(2, 1, 2)))
