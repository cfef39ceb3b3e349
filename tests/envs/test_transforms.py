"""The environment as a learner sees it."""

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torchrl.collectors import Collector
from torchrl.envs.utils import check_env_specs

from hyuav import InputError, Scenario, SecureOffloadingEnv, make_env
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.outcome import Control
from hyuav.physics.slot import slot
from reference import assert_same, fly, place, start_at

TWO_CLUSTERS = Scenario.preset("two_clusters")
RANDOM_DISK = Scenario.preset("random_disk")
SEEDS = st.integers(0, 2**31)


@pytest.mark.parametrize("batch_size", [(), (1,), (3,), (2, 3)])
@pytest.mark.parametrize("scheme", MODE_RULES)
@pytest.mark.parametrize("diagnostics", [False, True])
def test_the_specs_hold(batch_size: tuple[int, ...], scheme: str, diagnostics: bool) -> None:
    env = make_env(TWO_CLUSTERS, scheme, batch_size, seed=0, diagnostics=diagnostics)
    check_env_specs(env)
    assert env.batch_size == batch_size


@pytest.mark.parametrize("batch_size", [(), (1,), (2, 3)])
def test_the_specs_hold_with_a_clock(batch_size: tuple[int, ...]) -> None:
    check_env_specs(make_env(TWO_CLUSTERS, batch_size=batch_size, seed=0, clock=True))


@given(
    position=st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)),
    action=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    area=st.sampled_from(["box", "disc"]),
)
def test_a_geofence_lets_no_flight_leave_the_map(
    position: tuple[float, float], action: tuple[float, float], area: str
) -> None:
    scenario = dataclasses.replace(TWO_CLUSTERS, speed_limit=area)
    env = make_env(scenario, "jamming", 1, seed=0, geofence=True)
    found = fly(env, start_at(env, [list(position)]), list(action))
    assert not found["off_map"].any()
    free = torch.tensor(position) + torch.tensor(action) * scenario.max_speed
    expected = free.clamp(-100.0, 100.0)  # component by component
    if area == "box":
        torch.testing.assert_close(place(found)[0], expected, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("clock", [False, True])
def test_the_specs_hold_with_a_geofence(clock: bool) -> None:
    check_env_specs(make_env(TWO_CLUSTERS, batch_size=(2,), seed=0, clock=clock, geofence=True))


def test_what_a_geofence_slows_is_remembered_as_it_was_wanted() -> None:
    env = make_env(TWO_CLUSTERS, batch_size=(1,), seed=0, geofence=True)
    state = start_at(env, [[99.0, 0.0]])
    state["action"] = torch.tensor([[1.0, 0.5]])
    flown = env.step(state)
    assert flown["action"].tolist() == [[1.0, 0.5]]
    torch.testing.assert_close(place(flown["next"]), torch.tensor([[100.0, 10.0]]))


@pytest.mark.parametrize("num_slots", [1, 10, 20])
@pytest.mark.parametrize("batch_size", [(), (3,), (2, 3)])
def test_an_episode_is_truncated_after_its_slots_and_never_terminates(
    num_slots: int, batch_size: tuple[int, ...]
) -> None:
    scenario = dataclasses.replace(TWO_CLUSTERS, num_slots=num_slots)
    episode = make_env(scenario, batch_size=batch_size, seed=0).rollout(50)
    assert episode.batch_size == (*batch_size, num_slots)
    after = episode["next"]
    last = torch.arange(num_slots) == num_slots - 1
    for key in ("truncated", "done"):
        assert torch.equal(after[key][..., 0], last.expand(*batch_size, num_slots)), key
    assert not after["terminated"].any()
    assert not episode["done"].any()


def test_the_steps_and_the_return_of_an_episode_are_counted_from_its_start() -> None:
    env = make_env(RANDOM_DISK, "jamming", 4, seed=0)
    episodes = env.rollout(50, break_when_any_done=False)
    assert episodes.batch_size == (4, 50)
    after = episodes["next"]
    assert after["step_count"][0, :, 0].tolist() == [*range(1, 21), *range(1, 21), *range(1, 11)]
    for first, last in ((0, 20), (20, 40), (40, 50)):
        expected = after["reward"][:, first:last].cumsum(dim=1)
        torch.testing.assert_close(after["episode_reward"][:, first:last], expected)
    # Each episode starts anew.
    for first in (0, 20, 40):
        assert not episodes["episode_reward"][:, first].any()
        assert place(episodes)[:, first].tolist() == [[-60.0, -60.0]] * 4


@pytest.mark.parametrize("penalty", [0.2, 0.0, 1.5])
def test_leaving_the_map_costs_the_penalty(penalty: float) -> None:
    scenario = dataclasses.replace(RANDOM_DISK, fading=False, off_map_penalty=penalty)
    env, plain = (make(scenario, "jamming", 2, seed=0) for make in (make_env, SecureOffloadingEnv))
    position, action = [[95.0, 80.0], [60.0, 80.0]], [1.0, 0.0]
    found = fly(env, start_at(env, position), action)
    physical = fly(plain, start_at(plain, position), action)
    assert found["off_map"].tolist() == [[True], [False]]
    expected = physical["reward"] - torch.tensor([[penalty], [0.0]])
    assert bool((physical["reward"] > 1.0).all())
    torch.testing.assert_close(found["reward"], expected)
    torch.testing.assert_close(found["episode_reward"], expected)


def test_a_helper_that_stays_off_the_map_pays_in_every_slot() -> None:
    env = make_env(dataclasses.replace(RANDOM_DISK, fading=False), "relay", seed=0)
    state = start_at(env, [-100.0, -100.0])
    for slots in range(1, 6):
        state = fly(env, state, [-1.0, 0.0])
        assert float(state["reward"]) == pytest.approx(-0.2)
        assert float(state["episode_reward"]) == pytest.approx(-0.2 * slots)


def test_the_physical_entries_are_those_of_the_environment_below() -> None:
    env, plain = (
        make(RANDOM_DISK, batch_size=3, seed=4) for make in (make_env, SecureOffloadingEnv)
    )
    seen, physical = env.reset(), plain.reset()
    for action in ([1.0, 0.3], [0.5, 0.5], [-0.2, 1.0]):
        seen, physical = fly(env, seen, action), fly(plain, physical, action)
        for key in ("position", "mode", "distances", "off_map", "reward"):
            assert torch.equal(seen[key], physical[key]), key


def test_an_episode_may_start_at_any_given_position() -> None:
    env = make_env(RANDOM_DISK, batch_size=(2, 2), seed=0)
    position = torch.tensor([[[1.0, 2.0], [-3.0, 4.0]], [[100.0, -100.0], [0.0, 0.0]]])
    env.rollout(3)
    state = start_at(env, position)
    assert torch.equal(place(state), position)
    torch.testing.assert_close(state["observation"][..., :2], position / 100.0)
    assert not state["step_count"].any()
    assert not state["episode_reward"].any()


@pytest.mark.parametrize("beyond", [[100.5, 0.0], [0.0, -1e6], [0.0, float("nan")]])
def test_an_episode_cannot_start_off_the_map(beyond: list[float]) -> None:
    with pytest.raises(InputError, match=r"^position = .*on the map"):
        start_at(make_env(RANDOM_DISK, batch_size=2), [[0.0, 0.0], beyond])


def test_a_partial_reset_leaves_the_other_rows_in_flight() -> None:
    env = make_env(RANDOM_DISK, "jamming", 4, seed=0, diagnostics=True)
    flown = fly(env, start_at(env, [[70.0, 70.0]] * 4), [0.3, 0.4])
    chosen = torch.tensor([[True], [False], [True], [False]])
    state = env.reset(flown.clone().exclude("position").set("_reset", chosen))
    over, going = chosen[:, 0], ~chosen[:, 0]
    assert not state["step_count"][over].any()
    assert not state["episode_reward"][over].any()
    assert torch.equal(state["step_count"][going], flown["step_count"][going])
    assert torch.equal(state["episode_reward"][going], flown["episode_reward"][going])
    assert place(state)[over].tolist() == [[-60.0, -60.0]] * 2


def test_rows_that_are_over_restart_while_the_others_fly_on() -> None:
    env = make_env(RANDOM_DISK, "jamming", 2, seed=0, diagnostics=True)
    state = start_at(env, [[70.0, 70.0]] * 2)
    state["step_count"][1] = 19  # one slot left
    flown, following = env.step_and_maybe_reset(state.set("action", torch.full((2, 2), 0.5)))
    after = flown["next"]
    assert after["truncated"].tolist() == [[False], [True]]
    for key in ("position", "mode", "distances", "observation", "episode_reward", "step_count"):
        assert torch.equal(following[key][0], after[key][0]), key
    assert float(following["diagnostics", "edge_load"][0]) > 0.0
    assert place(following)[1].tolist() == [-60.0, -60.0]
    assert int(following["step_count"][1]) == 0
    assert float(following["episode_reward"][1]) == 0.0
    assert float(following["diagnostics", "edge_load"][1]) == 0.0
    # What the episode ended with is still told to the learner.
    assert place(after)[1].tolist() == [80.0, 80.0]


@pytest.mark.parametrize("scheme", MODE_RULES)
def test_the_same_seed_gives_the_same_episodes_with_and_without_diagnostics(scheme: str) -> None:
    episodes = []
    for seed, diagnostics in ((3, False), (3, True), (3, False), (4, False)):
        torch.manual_seed(0)  # of the random actions
        env = make_env(RANDOM_DISK, scheme, 8, seed=seed, diagnostics=diagnostics)
        start = env.rollout(25, break_when_any_done=False)
        episodes.append(start.exclude("diagnostics", ("next", "diagnostics")))
    assert_same(episodes[0], episodes[1])
    assert_same(episodes[0], episodes[2])
    assert not torch.equal(episodes[0]["next", "reward"], episodes[3]["next", "reward"])


def test_each_row_may_fly_its_own_scheme() -> None:
    episode = make_env(RANDOM_DISK, MODE_RULES, 3, seed=0).rollout(20)
    assert bool((episode["next", "mode"][1] == 1).all())
    assert bool((episode["next", "mode"][2] == 0).all())


def test_a_collector_works_unchanged() -> None:
    env = make_env(dataclasses.replace(TWO_CLUSTERS, num_slots=5), batch_size=3, seed=0)
    collector = Collector(env, None, frames_per_batch=36, total_frames=72)
    batches = list(collector)
    collector.shutdown()
    steps = torch.cat([batch["next", "step_count"] for batch in batches], dim=1)
    assert steps[0, :, 0].tolist() == [
        *range(1, 6),
        *range(1, 6),
        *range(1, 6),
        *range(1, 6),
        1,
        2,
        3,
        4,
    ]
    over = torch.cat([batch["next", "truncated"] for batch in batches], dim=1)
    assert torch.equal(over, steps == 5)


def test_no_entry_changes_its_type_or_shape_during_an_episode() -> None:
    env = make_env(RANDOM_DISK, batch_size=2, seed=0, diagnostics=True, clock=True)
    state = env.reset()
    start = {key: (value.dtype, value.shape) for key, value in state.items(True, True)}
    for _ in range(25):
        state = env.step_mdp(env.step(env.rand_action(state)))
        found = {key: (value.dtype, value.shape) for key, value in state.items(True, True)}
        found.pop("action", None)
        assert {key: found[key] for key in start if key in found} == {
            key: value for key, value in start.items() if key in found
        }
        assert set(start) <= set(found) | {"action"}
    assert torch.float64 not in {dtype for dtype, _ in start.values()}


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"scheme": "relying"}, "scheme"),
        ({"scenario": "disk"}, "scenario"),
        ({"batch_size": -1}, "batch_size"),
        ({"device": "tpu9"}, "device"),
        ({"seed": -3}, "seed"),
    ],
)
def test_bad_arguments_are_answered_in_one_line(arguments: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=f"^{field} = ") as caught:
        make_env(**{"scenario": TWO_CLUSTERS, **arguments})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("batch_size", [(), (3,)])
@pytest.mark.parametrize("fading", [True, False])
def test_the_fading_that_is_told_is_what_the_slot_was_earned_by(
    batch_size: tuple[int, ...], fading: bool
) -> None:
    scenario = dataclasses.replace(TWO_CLUSTERS, fading=fading, helper_starts=((-40.0, 0.0),))
    env = make_env(scenario, "relay", batch_size, seed=0, fading=True)
    check_env_specs(env)
    silent = make_env(scenario, "relay", batch_size, seed=0)
    found = env.rollout(5)["next"]
    assert found["fading"].shape == (*batch_size, 5, 3 * scenario.num_ues + 2)
    physics = env.base_env.physics
    nodes = physics.nodes._replace(helper=found["position"])
    powers = physics.link_row.unflatten(found["fading"])
    rates = slot(physics, nodes, Control(torch.zeros(1, 2)), powers).relay.sum_rate
    torch.testing.assert_close(found["reward"].squeeze(-1), rates - 0.2 * found["off_map"][..., 0])
    assert bool((found["fading"] == 1.0).all()) != fading
    assert "fading" not in silent.reset()
