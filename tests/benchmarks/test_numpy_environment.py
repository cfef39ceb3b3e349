"""The NumPy environment is the model: same flight and same draws, same numbers."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

import reference
import worlds
from benchmarks.numpy_environment import NumpyEnv
from hyuav import Scenario, make_env
from hyuav.physics.channel import rician_power
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import draw_tasks
from reference import changed, random_actions, torchrl_flight

TWO_CLUSTERS = Scenario.preset("two_clusters")
RANDOM_DISK = Scenario.preset("random_disk")


def slot_of_the_model(
    scenario: Scenario, scheme: str, position: Any, action: Any, fading: Any, cycles: Any
) -> tuple[reference.Flight, reference.Slot]:
    flown = reference.flight(scenario, scheme, position, action)
    return flown, reference.slot(scenario, scheme, flown.position, fading, cycles)


@given(st.data(), worlds.scenarios(), st.sampled_from(MODE_RULES), st.integers(0, 2**31))
def test_a_slot_is_the_models_slot_in_any_world(
    data: st.DataObject, scenario: Scenario, scheme: str, seed: int
) -> None:
    position = data.draw(worlds.helpers(scenario))
    action = data.draw(worlds.actions())
    env = NumpyEnv(scenario, scheme)
    rng = np.random.default_rng(seed)
    fading = rng.exponential(size=3 * scenario.num_ues + 2) if scenario.fading else None
    cycles = rng.uniform(*scenario.task_size, scenario.num_ues) * np.mean(scenario.cycles_per_bit)
    env.draw_fading = lambda: fading  # type: ignore[method-assign]
    env.draw_cycles = lambda: cycles  # type: ignore[method-assign]
    flown, slot = slot_of_the_model(scenario, scheme, position, action, fading, cycles)
    assume(min(flown.margin, slot.margin) > 1e-9)
    env.start = position
    env.reset()
    observation, reward, terminated, truncated, _ = env.step(np.array(action))
    penalty = scenario.off_map_penalty * flown.off_map
    assert reward == pytest.approx(slot.chosen.sum_rate - penalty, rel=1e-9, abs=1e-9)
    half = scenario.map_side / 2
    distances = [d / half - 1 for d in reference.distances(scenario, flown.position)]
    expected = [*(c / half for c in flown.position), 2 * slot.modes[0] - 1, *distances]
    np.testing.assert_allclose(observation, expected, rtol=1e-5, atol=1e-5)
    assert not terminated
    assert truncated == (scenario.num_slots == 1)


@pytest.mark.parametrize("scenario", [TWO_CLUSTERS, RANDOM_DISK], ids=["clusters", "disk"])
@pytest.mark.parametrize("scheme", MODE_RULES)
def test_flights_without_fading_are_those_of_the_learners_environment(
    scenario: Scenario, scheme: str
) -> None:
    scenario = changed(scenario, fading=False)
    actions = random_actions(3, 20).swapaxes(0, 1)
    slots = torchrl_flight(make_env(scenario, scheme, 3), actions)
    for row in range(3):
        env = NumpyEnv(scenario, scheme)
        env.reset()
        for slot, action in zip(slots, actions[:, row], strict=True):
            observation, reward, _, truncated, _ = env.step(action)
            np.testing.assert_allclose(observation, slot["observation"][row], atol=1e-5)
            assert reward == pytest.approx(slot["reward"][row].item(), abs=1e-4)
            assert truncated == slot["truncated"][row].item()


@pytest.mark.parametrize("scheme", MODE_RULES)
def test_sum_rates_are_those_of_the_physics_at_the_same_draws(scheme: str) -> None:
    physics = Physics(RANDOM_DISK, dtype=torch.float64)
    generator = torch.Generator().manual_seed(3)
    env = NumpyEnv(RANDOM_DISK, scheme)
    for _ in range(200):
        position = 200 * torch.rand(2, generator=generator, dtype=torch.float64) - 100
        fading = physics.draw_fading((), generator)
        assert fading is not None
        env.draw_fading = fading.numpy  # type: ignore[method-assign]
        env.x, env.y = position.tolist()
        slot = reference.hover(physics, position, fading)
        relay, jamming = slot.relay.sum_rate.item(), slot.jamming.sum_rate.item()
        chosen = {"hybrid": max(relay, jamming), "relay": relay, "jamming": jamming}
        rate, _ = env._slot()
        assert rate == pytest.approx(chosen[scheme], abs=1e-9)
        assert env.relay == (scheme == "relay" or (scheme == "hybrid" and relay > jamming))


def test_its_fading_follows_the_models_law() -> None:
    env, draws = NumpyEnv(TWO_CLUSTERS, seed=1), 20_000
    own = np.stack([np.copy(env.draw_fading()) for _ in range(draws)])  # type: ignore[arg-type]
    physics = Physics(TWO_CLUSTERS, dtype=torch.float64)
    model = rician_power(physics.k_factor, (draws, 32), torch.Generator().manual_seed(2)).numpy()
    np.testing.assert_allclose(own.mean(0), 1.0, atol=0.015)
    np.testing.assert_allclose(own.mean(0), model.mean(0), atol=0.02)
    np.testing.assert_allclose(own.std(0), model.std(0), rtol=0.06)
    correlation = np.corrcoef(own.T)
    assert np.abs(correlation - np.eye(32)).max() < 0.04


def test_its_tasks_follow_the_models_law() -> None:
    env = NumpyEnv(TWO_CLUSTERS, seed=1)
    own = np.stack([env.draw_cycles() for _ in range(5000)])
    tasks = draw_tasks(TWO_CLUSTERS, (5000,), torch.Generator().manual_seed(2), torch.float64)
    model = tasks.cpu_cycles.numpy()
    assert own.mean() == pytest.approx(model.mean(), rel=0.01)
    assert own.std() == pytest.approx(model.std(), rel=0.03)


def test_the_same_seed_flies_the_same_episode() -> None:
    rewards = []
    for _ in range(2):
        env = NumpyEnv(TWO_CLUSTERS)
        env.reset(seed=7)
        rewards.append([env.step(action)[1] for action in random_actions(20)])
    assert rewards[0] == rewards[1]


def test_a_new_episode_begins_at_the_start() -> None:
    env = NumpyEnv(TWO_CLUSTERS, seed=0)
    first, _ = env.reset()
    for _ in range(20):
        truncated = env.step(np.array([1.0, 0.5]))[3]
    assert truncated
    again, _ = env.reset()
    np.testing.assert_array_equal(np.delete(first, 2), np.delete(again, 2))
