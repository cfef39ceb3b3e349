"""A compiled environment flies as the eager one does."""

import dataclasses
import shutil
from typing import Any

import pytest
import torch
from tensordict import TensorDictBase

from hyuav import InputError, Scenario, make_env
from hyuav.physics.modes import MODE_RULES
from hyuav.references.straight import ConstantVelocity

TWO_CLUSTERS = Scenario.preset("two_clusters")
FULL_EDGE = dataclasses.replace(
    Scenario.preset("random_disk"), edge_energy_budget=1.0, speed_limit="disc", num_slots=6
)
SIXTY = range(60)
FAIR: dict[str, Any] = {"batch_size": 300, "clock": True, "reward": "proportional_fairness"}
"""What two tests ask for, so that its program is compiled once."""

COMPILES = pytest.mark.skipif(shutil.which("g++") is None, reason="needs a C++ compiler")


def both_flights(scenario: Scenario, **options: Any) -> tuple[TensorDictBase, TensorDictBase]:
    """Some slots from all over the map, eager and compiled."""
    generator = torch.Generator().manual_seed(0)
    envs = [make_env(scenario, compiled=fast, **options) for fast in (False, True)]
    shape = (*envs[0].batch_size, 2)
    start = (torch.rand(shape, generator=generator) - 0.5).unsqueeze(-2) * scenario.map_side
    actions = [3 * torch.rand(shape, generator=generator) - 1.5 for _ in range(6)]
    flights, resets = [], dict[str, TensorDictBase]()
    for env in envs:
        state, slots = (
            env.reset(env.fake_tensordict().select("position").set_("position", start)),
            [],
        )
        for action in actions:
            flown = env.step(state.set("action", action))
            slots.append(flown["next"])
            state = env.step_mdp(flown)
        positions, modes, count = env.base_env.recorder.flight(0)
        first = [slot.flatten()[0] for slot in slots]
        assert count == len(actions)
        assert positions[1:].tolist() == [slot["position"].tolist() for slot in first]
        assert modes[1:].tolist() == [slot["mode"].tolist() for slot in first]
        # Once compiled, a reset is another way through the same graph.
        anew = env.reset()
        assert env.base_env.recorder.flight(0)[2] == 0
        assert_equal_up_to_rounding(anew, resets.setdefault("eager", anew))
        flights.append(torch.stack(slots))
    assert not envs[1]._eager
    return flights[0], flights[1]


def assert_equal_up_to_rounding(eager: TensorDictBase, fast: TensorDictBase) -> None:
    assert set(eager.keys(True, True)) == set(fast.keys(True, True))
    for key in eager.keys(True, True):
        assert eager[key].dtype == fast[key].dtype, key
        torch.testing.assert_close(fast[key], eager[key], rtol=2e-5, atol=1e-4, msg=str(key))


@pytest.fixture(
    scope="module",
    params=[
        FAIR["reward"],
        pytest.param("secrecy_energy_efficiency", marks=pytest.mark.slow),
    ],
)
def flown(request: pytest.FixtureRequest) -> tuple[TensorDictBase, TensorDictBase]:
    """Eager and compiled, by a reward."""
    return both_flights(TWO_CLUSTERS, seed=1, **FAIR | {"reward": request.param})


@COMPILES
def test_compiled_slots_earn_what_was_asked_for(
    flown: tuple[TensorDictBase, TensorDictBase],
) -> None:
    eager, fast = flown
    assert fast["reward"].max() > 0.0
    torch.testing.assert_close(fast["reward"], eager["reward"], rtol=2e-5, atol=1e-4)


@COMPILES
def test_compiled_slots_are_those_of_the_eager_environment(
    flown: tuple[TensorDictBase, TensorDictBase],
) -> None:
    eager, fast = flown
    assert eager["off_map"].any()
    assert 0.0 < eager["mode"].double().mean() < 1.0
    assert_equal_up_to_rounding(eager, fast)


@COMPILES
def test_a_scheme_and_a_seed_for_each_row_a_full_edge_and_a_disc_compile_too() -> None:
    eager, fast = both_flights(
        FULL_EDGE,
        scheme=[MODE_RULES[row % 3] for row in SIXTY],
        batch_size=(60, 4),
        seed=[row // 2 for row in SIXTY],
        diagnostics=True,
    )
    assert (eager["diagnostics", "edge_load"] > 0).any()
    assert_equal_up_to_rounding(eager, fast)


@COMPILES
@pytest.mark.slow
def test_agents_fly_in_compiled_slots_too() -> None:
    scenario = dataclasses.replace(TWO_CLUSTERS, helper_starts=((-60.0, -60.0), (60.0, -60.0)))
    envs = [
        make_env(scenario, batch_size=8, seed=0, agents=True, compiled=fast)
        for fast in (False, True)
    ]
    states = [env.reset() for env in envs]
    for slot in range(3):
        for state in states:
            state["helpers", "action"] = torch.full((8, 2, 2), 0.3 * slot)
        flown = [env.step(state)["next"] for env, state in zip(envs, states, strict=True)]
        assert flown[1]["helpers"].batch_size == (8, 2)
        assert_equal_up_to_rounding(*flown)
        states = [after.exclude(("helpers", "reward")) for after in flown]
    assert_equal_up_to_rounding(envs[0].reset(), envs[1].reset())


@COMPILES
def test_slots_without_fading_compile_too() -> None:
    calm = dataclasses.replace(TWO_CLUSTERS, fading=False)
    assert_equal_up_to_rounding(*both_flights(calm, scheme="relay", batch_size=64, seed=0))


def test_without_a_compiler_the_environment_is_the_eager_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    eager, fallen_back = (
        make_env(TWO_CLUSTERS, batch_size=3, seed=4, compiled=fast).rollout(
            20, ConstantVelocity(TWO_CLUSTERS, [(0.0, 0.0)], "jamming")
        )
        for fast in (False, True)
    )
    torch.testing.assert_close(fallen_back, eager, rtol=0, atol=0)


@COMPILES
def test_actions_are_read_as_they_are_and_seeds_may_change_their_kind() -> None:
    eager, fast = (
        make_env(TWO_CLUSTERS, seed=[*range(300)], compiled=compiled, **FAIR)
        for compiled in (False, True)
    )
    actions = torch.rand(300, 2, dtype=torch.float64) * 2 - 1
    first, second = (env.step(env.reset().set("action", actions))["next"] for env in (eager, fast))
    torch.testing.assert_close(second["reward"], first["reward"], rtol=2e-5, atol=1e-4)
    for env in (eager, fast):
        env.set_seed([*range(1, 301)], static_seed=True)
    assert fast._flight is not None
    first, second = (env.step(env.reset().set("action", actions))["next"] for env in (eager, fast))
    torch.testing.assert_close(second["reward"], first["reward"], rtol=2e-5, atol=1e-4)
    for env in (eager, fast):
        env.set_seed(3)
    first, second = (env.step(env.reset().set("action", actions))["next"] for env in (eager, fast))
    torch.testing.assert_close(second["reward"], first["reward"], rtol=2e-5, atol=1e-4)
    with pytest.raises(InputError, match=r"^action = \(300, 3\): expected shape \(300, 2\)$"):
        fast.step(fast.reset().set("action", torch.zeros(300, 3)))
