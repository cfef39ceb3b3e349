"""A slot is one graph of torch.compile, which is made once."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import pytest
import torch
from tensordict import TensorDictBase
from torchrl.envs import EnvBase

from hyuav import Scenario, SecureOffloadingEnv, make_env

FULL_EDGE = dataclasses.replace(Scenario.preset("random_disk"), edge_energy_budget=1.0)


@pytest.fixture(autouse=True)
def _forget_graphs() -> Iterator[None]:
    torch.compiler.reset()
    yield
    torch.compiler.reset()


def flown(env: EnvBase, *, compiled: bool) -> TensorDictBase:
    """Some slots with a policy, (slots, ...).

    The first is flown without a graph: what a reset gives has its entries in another order than
    what follows a slot, by which TorchRL's graphs are told apart.
    """

    def fly_slot(state: TensorDictBase) -> tuple[TensorDictBase, TensorDictBase]:
        state["action"] = (state["position"] / 100.0 + 0.3).reshape(env.action_spec.shape)
        brought = env.step(state)
        return brought["next"], env.step_mdp(brought)

    _, state = fly_slot(env.reset())
    if compiled:
        fly_slot = torch.compile(fly_slot, fullgraph=True, backend="eager")
    slots = []
    for slot in range(5):
        with torch.compiler.set_stance("fail_on_recompile" if slot > 0 else "default"):
            brought, state = fly_slot(state)
        slots.append(brought)
    return torch.stack(slots)


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (SecureOffloadingEnv, {"scenario": "two_clusters", "batch_size": (4,)}),
        (
            make_env,
            {"scenario": FULL_EDGE, "batch_size": (3, 2), "diagnostics": True, "clock": True},
        ),
    ],
)
def test_slots_fly_through_one_graph_and_bring_what_they_do_without(
    make: Any, options: dict[str, Any]
) -> None:
    eager, fast = (flown(make(**options, seed=1), compiled=each) for each in (False, True))
    assert (eager["reward"].diff(dim=0) != 0).any()
    for key in eager.keys(include_nested=True, leaves_only=True):
        torch.testing.assert_close(fast[key], eager[key], rtol=1e-5, atol=1e-5, msg=str(key))


def test_slots_flown_with_and_without_a_graph_follow_each_other() -> None:
    envs = [SecureOffloadingEnv("two_clusters", seed=2) for _ in range(2)]
    still = torch.zeros(envs[0].action_spec.shape)
    graph = torch.compile(envs[1].step, fullgraph=True, backend="eager")
    for slot in range(4):
        steps = envs[0].step, graph if slot % 2 else envs[1].step
        states = [env.reset().set("action", still) for env in envs]
        brought = [step(state) for step, state in zip(steps, states, strict=True)]
        torch.testing.assert_close(*(each["next", "reward"] for each in brought))
    assert envs[0].draws.state()["fading"] == envs[1].draws.state()["fading"] == 8
