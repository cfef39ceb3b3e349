"""What the diagnostics entry accounts for."""

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict

from hyuav import Scenario, SecureOffloadingEnv
from hyuav.physics.modes import MODE_RULES

RANDOM_DISK = Scenario.preset("random_disk")
QUIET = dataclasses.replace(RANDOM_DISK, fading=False)
SEEDS = st.integers(0, 2**31)


def flights(scenario: Scenario, scheme: str, seed: int, rows: int = 64) -> Any:
    """Two slots by ``rows`` helpers that start anywhere on the map."""
    env = SecureOffloadingEnv(scenario, scheme, rows, seed=seed, diagnostics=True)
    generator = torch.Generator().manual_seed(seed)
    state = env.reset(
        TensorDict(
            {"position": 200 * torch.rand(rows, 1, 2, generator=generator) - 100}, batch_size=rows
        )
    )
    slots = []
    for _ in range(2):
        action = 2 * torch.rand(rows, 1, 2, generator=generator) - 1
        state = env.step(state.clone().set("action", action))["next"]
        slots.append(state)
    return slots


@given(SEEDS, st.sampled_from(MODE_RULES))
def test_the_reward_is_the_sum_of_the_secrecy_rates_of_the_offloading_ues(
    seed: int, scheme: str
) -> None:
    slot = flights(RANDOM_DISK, scheme, seed)[0]
    details = slot["diagnostics"]
    torch.testing.assert_close(details["secrecy_rate"].sum(-1, keepdim=True), slot["reward"])
    assert bool((details["secrecy_rate"][details["offloading"]] > 0.1).all())
    assert not details["secrecy_rate"][~details["offloading"]].any()


@given(SEEDS, st.sampled_from(MODE_RULES))
def test_a_ue_outside_the_coverage_never_offloads(seed: int, scheme: str) -> None:
    scenario = dataclasses.replace(RANDOM_DISK, coverage_radius=30.0)
    slot = flights(scenario, scheme, seed)[0]
    to_legitimate = torch.tensor(scenario.ue_positions).norm(dim=-1)
    offloading = slot["diagnostics", "offloading"]
    assert not offloading[:, to_legitimate > 30.0].any()
    beyond_helper = (slot["distances"][:, 0, :10] > 30.0) & (slot["mode"] == 1)
    assert not (offloading & beyond_helper).any()


def test_what_a_ue_spends_is_sending_or_computing() -> None:
    slot = flights(RANDOM_DISK, "hybrid", 0)[0]
    offloading, spent = slot["diagnostics", "offloading"], slot["diagnostics", "ue_energy"]
    relaying = (slot["mode"] == 1).expand_as(offloading)
    assert spent[offloading & relaying].unique().tolist() == pytest.approx([0.005])
    assert spent[offloading & ~relaying].unique().tolist() == pytest.approx([0.01])
    local = spent[~offloading]
    assert float(local.min()) >= 1e-27 * (160e3 * 1000) ** 3 * (1 - 1e-5)
    assert float(local.max()) <= 1e-27 * (240e3 * 1200) ** 3 * (1 + 1e-5)
    assert local.unique().numel() > local.numel() // 2


@given(SEEDS, st.sampled_from(MODE_RULES))
def test_the_load_taken_in_one_slot_is_computed_in_the_next(seed: int, scheme: str) -> None:
    first, second = (slot["diagnostics"] for slot in flights(RANDOM_DISK, scheme, seed))
    assert not first["edge_energy"].any()
    torch.testing.assert_close(
        second["edge_energy"].double(), 1e-27 * first["edge_load"].double() ** 3, rtol=1e-5, atol=0
    )
    taken = first["offloading"].sum(-1, keepdim=True)
    assert bool((first["edge_load"] >= taken * 160e3 * 1000 * (1 - 1e-6)).all())
    assert bool((first["edge_load"] <= taken * 240e3 * 1200 * (1 + 1e-6)).all())


def test_relaying_costs_energy_only_for_the_ues_that_offload() -> None:
    env = SecureOffloadingEnv(QUIET, "relay", 2, seed=0, diagnostics=True)
    position = torch.tensor([[[-20.0, -20.0]], [[100.0, 100.0]]])
    state = env.reset(TensorDict({"position": position}, batch_size=2))
    state = env.step(state.set("action", torch.zeros(2, 1, 2)))["next"]
    assert state["diagnostics", "offloading"].sum(-1).tolist() == [5, 0]
    spent = state["diagnostics", "helper_energy"].flatten().tolist()
    assert spent == pytest.approx([5 * 0.012 / 20, 0.0])


def test_jamming_costs_energy_even_if_nobody_offloads() -> None:
    env = SecureOffloadingEnv(QUIET, "jamming", seed=0, diagnostics=True)
    state = env.step(env.reset().set("action", torch.zeros(1, 2)))["next"]
    assert not state["diagnostics", "offloading"].any()
    assert float(state["diagnostics", "helper_energy"]) == pytest.approx(0.08)


@pytest.mark.parametrize("scheme", MODE_RULES)
def test_both_modes_are_reported_whichever_is_chosen(scheme: str) -> None:
    slot = flights(RANDOM_DISK, scheme, 3)[0]
    relay, jamming = slot["diagnostics", "relay_sum_rate"], slot["diagnostics", "jamming_sum_rate"]
    assert relay.any()
    assert jamming.any()
    chosen = torch.where(slot["mode"] == 1, relay, jamming)
    assert torch.equal(chosen, slot["reward"])
    if scheme == "hybrid":
        assert torch.equal(chosen, torch.maximum(relay, jamming))
        assert torch.equal(slot["mode"] == 1, relay > jamming)


def test_every_node_over_its_budget_is_counted_once() -> None:
    # 4 mJ to 24 mJ per local task, so that 10 mJ and 15 mJ part the UEs.
    for budget in (0.0101, 0.015, 0.02, 0.0239):
        scenario = dataclasses.replace(RANDOM_DISK, ue_energy_budget=budget)
        details = flights(scenario, "hybrid", 5)[0]["diagnostics"]
        above = (details["ue_energy"] > budget).sum(-1, keepdim=True)
        assert torch.equal(details["budget_violation"], above)
        assert bool((above > 0).any()) == (budget < 0.0239)
    scenario = dataclasses.replace(
        RANDOM_DISK, ue_energy_budget=0.0, helper_energy_budget=0.0, edge_energy_budget=0.0
    )
    details = flights(scenario, "jamming", 0)[1]["diagnostics"]
    assert details["budget_violation"].flatten().tolist() == [11] * 64


def test_a_load_beyond_the_edges_budget_is_counted() -> None:
    env = SecureOffloadingEnv(QUIET, diagnostics=True, seed=0)
    for load, violations in ((2.8e9, 0), (2.9e9, 1)):  # 21.95 J and 24.39 J
        state = env.reset()
        state["diagnostics", "edge_load"] = torch.tensor([load])
        state = env.step(state.set("action", torch.zeros(1, 2)))["next"]
        assert float(state["diagnostics", "edge_energy"]) == pytest.approx(
            1e-27 * load**3, rel=1e-5
        )
        assert int(state["diagnostics", "budget_violation"]) == violations


@pytest.mark.parametrize("batch_size", [(), (1,), (2, 3)])
def test_after_a_reset_there_is_nothing_to_account_for(batch_size: tuple[int, ...]) -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, batch_size=batch_size, seed=0, diagnostics=True)
    env.rollout(3)
    for value in env.reset()["diagnostics"].values():
        assert value.shape[: len(batch_size)] == batch_size
        assert not value.any()


def test_the_spec_names_every_entry() -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, batch_size=2, seed=0, diagnostics=True)
    spec = env.observation_spec["diagnostics"]
    details = env.rollout(1)["next", "diagnostics"][:, 0]
    assert set(spec.keys()) == set(details.keys())
    assert spec.is_in(details)
