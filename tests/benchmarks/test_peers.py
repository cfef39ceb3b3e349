"""Every library does the same work: one update after every slot, once a mini-batch is stored."""

import dataclasses
import importlib
from typing import Any

import numpy as np
import pytest

from benchmarks import worker
from benchmarks.work import Work
from hyuav import Scenario
from hyuav.learning.ddpg import DDPG
from hyuav.learning.training import TrainingParameters

WORK = Work(Scenario.preset("two_clusters"))


def build(name: str, work: Work = WORK) -> Any:
    for library in worker.LIBRARIES.get(name, ()):
        pytest.importorskip(library)
    module, entry = worker.ENTRIES[name]
    return getattr(importlib.import_module(f"benchmarks.{module}"), entry)(work)


def weights(name: str, loop: Any) -> list[Any]:
    """Actor, critic and both targets, as lists of arrays."""
    if name == "cleanrl":
        modules = (loop.actor, loop.critic, loop.actor_target, loop.critic_target)
        return [[p.detach().clone().numpy() for p in module.parameters()] for module in modules]
    if name == "torchrl":
        loss = loop.loss
        groups = (
            *(loss.actor_network_params, loss.value_network_params),
            *(loss.target_actor_network_params, loss.target_value_network_params),
        )
        return [
            [
                parameter.detach().clone().numpy()
                for key, parameter in group.flatten_keys().items()
                if key.endswith(("weight", "bias"))
            ]
            for group in groups
        ]
    model = loop.model
    if name == "stable_baselines3":
        modules = (model.actor, model.critic, model.actor_target, model.critic_target)
        return [[p.detach().clone().numpy() for p in module.parameters()] for module in modules]
    leaves = importlib.import_module("jax").tree_util.tree_leaves
    actor, critic = model.policy.actor_state, model.policy.qf_state
    trees = (actor.params, critic.params, actor.target_params, critic.target_params)
    return [[leaf.__array__().copy() for leaf in leaves(tree)] for tree in trees]


@pytest.mark.parametrize("name", ["cleanrl", "torchrl", "stable_baselines3", "sbx"])
def test_a_peer_updates_all_networks_once_after_every_slot(name: str) -> None:
    loop = build(name)
    before = weights(name, loop)
    sizes = [sum(p.size for p in network) for network in before]
    slots = loop.advance()
    assert loop.updates == slots - WORK.batch_size + 1
    assert sizes == [45_202, 45_701, 45_202, 45_701]
    for old, new in zip(before, weights(name, loop), strict=True):
        changes = [float(abs(a - b).max()) for a, b in zip(old, new, strict=True)]
        assert min(changes) > 0.0
    moved, followed = (
        abs(weights(name, loop)[network][0] - before[network][0]).max() for network in (0, 2)
    )
    assert followed < moved  # the targets lag behind
    assert loop.advance() == slots
    assert loop.updates == 2 * slots - WORK.batch_size + 1


def test_this_project_updates_once_after_every_slot() -> None:
    loop = build("hyuav", Work(WORK.scenario, learners=2, batch_size=10, compile="never"))
    slots = loop.advance() + loop.advance()
    assert slots == 40
    assert loop.width == 2
    assert loop.updates == 31


def test_the_work_is_what_the_project_calls_the_papers_settings() -> None:
    algorithm, training = DDPG(), TrainingParameters()
    for name in (
        *("hidden_sizes", "actor_learning_rate", "critic_learning_rate", "discount"),
        *("target_rate", "noise_variance", "noise_decay"),
    ):
        assert getattr(WORK, name) == getattr(algorithm, name)
    assert algorithm.activation == "tanh"
    assert algorithm.noise_decay_per == "slot"
    assert WORK.batch_size == training.batch_size
    assert WORK.replay_size == training.replay_size


def test_work_survives_the_way_to_its_process() -> None:
    assert Work.from_dict(WORK.to_dict()) == WORK


def test_the_exploration_noise_decays_from_the_papers_variance() -> None:
    pytest.importorskip("stable_baselines3")
    noise = importlib.import_module("hyuav.experiments.comparison.peer").DecayingNoise(
        0.6, 0.999, 0
    )
    draws = np.stack([noise() for _ in range(4000)])
    assert draws[:200].var() == pytest.approx(0.6 * 0.82, rel=0.2)  # mean of 0.998^n
    assert draws[3000:].std() < 0.06


@pytest.mark.parametrize("name", ["make_env", "compiled_env", "random_numbers", "numpy"])
def test_the_environments_fly_whole_episodes(name: str) -> None:
    loop = build(name, Work(WORK.scenario, helpers=3))
    assert loop.advance() == WORK.scenario.num_slots
    assert loop.width == (1 if name == "numpy" else 3)


def test_five_schemes_are_evaluated_and_three_optima_solved() -> None:
    small = dataclasses.replace(WORK.scenario, num_slots=10, fading=False)
    work = dataclasses.replace(WORK, scenario=small, episodes=4)
    assert build("five_schemes", work).advance() == 5 * 4 * 10
    assert build("optima", work).advance() == 3 * 10
