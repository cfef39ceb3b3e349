"""The environment with several helpers and eavesdroppers, and with power control."""

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torchrl.envs.utils import check_env_specs

import reference
from hyuav import InputError, Scenario, SecureOffloadingEnv, make_env
from reference import next_draws

TWO = dataclasses.replace(
    Scenario.preset("two_clusters"),
    helper_starts=((-60.0, -60.0), (60.0, -60.0)),
    eavesdropper_positions=((80.0, 80.0), (-80.0, 60.0)),
)
POWER = dataclasses.replace(Scenario.preset("two_clusters"), power_control=True)
SEEDS = st.integers(0, 2**31)


@pytest.mark.parametrize("power_control", [False, True])
def test_the_entries_have_the_helpers_axis(power_control: bool) -> None:
    scenario = dataclasses.replace(TWO, power_control=power_control)
    env = SecureOffloadingEnv(scenario, batch_size=(3,), seed=0, diagnostics=True)
    check_env_specs(env, seed=0)
    entries = env.rollout(4)["next"]
    shapes = {name: tuple(entries[name].shape[2:]) for name in ("position", "mode", "off_map")}
    assert shapes == {"position": (2, 2), "mode": (2,), "off_map": (2,)}
    assert entries["distances"].shape == (3, 4, 2, 10 + 1 + 2)
    assert entries["diagnostics", "helper_energy"].shape == (3, 4, 2)
    assert env.action_spec.shape == (3, 2, 3 if power_control else 2)
    joint = make_env(scenario, batch_size=(3,), seed=0)
    check_env_specs(joint, seed=0)
    assert joint.action_spec.shape == (3, 6 if power_control else 4)
    assert joint.observation_spec["observation"].shape == (3, 2 * (2 + 1 + 13))


@given(SEEDS, st.sampled_from(["hybrid", "relay", "jamming", "rj", "jr"]))
def test_a_slot_is_that_of_scalar_loops(seed: int, scheme: str) -> None:
    env = SecureOffloadingEnv(TWO, scheme, 4, seed=seed, diagnostics=True)
    state = env.reset()
    generator = torch.Generator().manual_seed(seed)
    for _ in range(3):
        action = 2 * torch.rand(4, 2, 2, generator=generator) - 1
        powers, cycles = next_draws(env)
        before = state["position"].tolist()
        state = env.step(state.set("action", action))["next"]
        for row in range(4):
            flights = [
                reference.flight(TWO, "hybrid", place, own)
                for place, own in zip(before[row], action[row].tolist(), strict=True)
            ]
            places = [flight.position for flight in flights]
            slot = reference.slot(TWO, scheme, places, powers[row], cycles[row])
            if min(slot.margin, *(flight.margin for flight in flights)) < 1e-4:
                continue
            found = state[row]
            assert found["mode"].tolist() == list(slot.modes)
            assert found["reward"].item() == pytest.approx(slot.chosen.sum_rate, abs=2e-4)
            assert found["diagnostics", "offloading"].tolist() == slot.chosen.offloading
            assert found["diagnostics", "ue_energy"].tolist() == pytest.approx(
                slot.ue_energy, rel=1e-4
            )
            spent = [
                flight.energy + sending
                for flight, sending in zip(flights, slot.transmission_energy, strict=True)
            ]
            assert found["diagnostics", "helper_energy"].tolist() == pytest.approx(spent, rel=1e-4)


def test_the_penalty_counts_each_helper_that_would_leave_the_map() -> None:
    scenario = dataclasses.replace(TWO, helper_starts=((-99.0, 0.0), (99.0, 0.0)))
    env = make_env(scenario, batch_size=(3,), seed=0)
    outwards = torch.tensor([[-1.0, 0, 0, 0], [-1.0, 0, 1.0, 0], [1.0, 0, -1.0, 0]])
    flown = env.step(env.reset().set("action", outwards))["next"]
    raw = SecureOffloadingEnv(scenario, batch_size=(3,), seed=0)
    paid = raw.step(raw.reset().set("action", outwards.reshape(3, 2, 2)))["next", "reward"]
    assert flown["off_map"].tolist() == [[True, False], [True, True], [False, False]]
    torch.testing.assert_close(paid - flown["reward"], torch.tensor([[0.2], [0.4], [0.0]]))


def test_the_nominal_power_is_the_papers_case_number_for_number() -> None:
    fixed, controlled = (
        make_env(scenario, batch_size=(8,), seed=1)
        for scenario in (Scenario.preset("two_clusters"), POWER)
    )
    before, state = fixed.reset(), controlled.reset()
    for action in 2 * torch.rand(10, 8, 2, generator=torch.Generator().manual_seed(0)) - 1:
        nominal = torch.cat([action, torch.ones(8, 1)], dim=-1)
        before = fixed.step_mdp(fixed.step(before.set("action", action)))
        state = controlled.step_mdp(controlled.step(state.set("action", nominal)))
        for name in ("observation", "mode", "episode_reward"):
            assert torch.equal(before[name], state[name])


@pytest.mark.parametrize(("action", "decibels"), [(1.0, 0.0), (0.0, -30.0), (-1.0, -60.0)])
def test_the_power_falls_by_decibels(action: float, decibels: float) -> None:
    scenario = dataclasses.replace(POWER, fading=False)
    weaker = dataclasses.replace(
        Scenario.preset("two_clusters"),
        fading=False,
        jamming_power=0.08 * 10 ** (decibels / 10),
        relay_power=0.012 * 10 ** (decibels / 10),
    )
    place = torch.tensor([[90.0, 90.0]])
    found, expected = (
        env.step(env.reset(env.reset().set("position", place)).set("action", own))["next", "reward"]
        for env, own in (
            (SecureOffloadingEnv(scenario), torch.tensor([[0.0, 0.0, action]])),
            (SecureOffloadingEnv(weaker), torch.zeros(1, 2)),
        )
    )
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-5)


def test_the_best_jamming_power_beside_the_eavesdropper_is_far_below_the_papers() -> None:
    scenario = dataclasses.replace(POWER, fading=False)
    env = SecureOffloadingEnv(scenario, batch_size=(61,))
    place = torch.full((61, 1, 2), 90.0)
    levels = torch.linspace(-1.0, 1.0, 61)
    action = torch.stack([torch.zeros(61), torch.zeros(61), levels], dim=-1).unsqueeze(-2)
    state = env.reset(env.reset().set("position", place))
    reward = env.step(state.set("action", action))["next", "reward"].squeeze(-1)
    assert float(reward.max()) == pytest.approx(47.2, abs=0.05)
    assert int(reward.argmax()) == 60 - 29  # dB below the nominal power
    assert float(reward[-1]) < 4.03


@pytest.mark.parametrize("scheme", ["r", "rrr", "xj", "both"])
def test_modes_that_do_not_fit_the_helpers_are_refused(scheme: str) -> None:
    with pytest.raises(InputError, match=r"^scheme.* a letter r or j for each of 2 helpers"):
        SecureOffloadingEnv(TWO, scheme)


@pytest.mark.parametrize("value", [0.0, -1.0, 120.1, "60"])
def test_a_power_range_out_of_reach_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match=r"^power_range = .*expected"):
        dataclasses.replace(POWER, power_range=value)
