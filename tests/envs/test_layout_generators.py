"""Environments whose layouts are drawn anew at each reset."""

import dataclasses
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector
from torchrl.envs.utils import check_env_specs

from hyuav import ClustersLayout, DiskLayout, InputError, LayoutFamily, Scenario, make_env
from hyuav.envs.gymnasium import SecureOffloadingGymEnv, SecureOffloadingVectorEnv
from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.physics.layout import Nodes

SHORT = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=4)
FAMILY = LayoutFamily(DiskLayout(num_ues=6), SHORT)


@dataclasses.dataclass(frozen=True)
class Line:
    """UEs in a line, and all nodes that do not fly somewhere else in each layout."""

    scenario: Scenario = dataclasses.replace(SHORT, ue_positions=((0.0, 0.0),) * 5)
    size: int = 3

    def draw(self, draws: Tensor) -> Nodes:
        first, legitimate, eavesdropper = (100.0 * draws - 50.0).unbind(dim=-1)
        x = first.unsqueeze(-1) + torch.arange(5, device=draws.device)
        ue = torch.stack([x, torch.zeros_like(x)], dim=-1)
        at = (each.unsqueeze(-1).expand(*each.shape, 2) for each in (legitimate, eavesdropper))
        legitimate, eavesdropper = at
        helper = torch.full((1, 2), -60.0, device=draws.device)
        return Nodes(ue, legitimate, helper, eavesdropper.unsqueeze(-2))


def require_true_distances(state: Any) -> None:
    """The distances that are observed are those to the nodes that are told."""
    to_ues = (state["position"] - state["ue_positions"]).norm(dim=-1)
    torch.testing.assert_close(state["distances"][..., 0, :-2], to_ues)
    to_legitimate = (state["position"][..., 0, :] - state["legitimate_position"]).norm(dim=-1)
    torch.testing.assert_close(state["distances"][..., 0, -2], to_legitimate)
    to_eavesdropper = (state["position"] - state["eavesdropper_positions"]).norm(dim=-1)
    torch.testing.assert_close(state["distances"][..., 0, -1:], to_eavesdropper)


def fly_northeast(env: Any, slots: int) -> TensorDictBase:
    """Slots of as many episodes as fit in."""
    state, flown = env.reset(), []
    for _ in range(slots):
        state["action"] = torch.full((*env.batch_size, 2), 0.5)
        slot, state = env.step_and_maybe_reset(state)
        flown.append(slot)
    return torch.stack(flown, dim=1)


def same(first: Tensor, second: Tensor) -> list[bool]:
    """In which rows two layouts are the same."""
    return (first == second).flatten(1).all(dim=1).tolist()


@pytest.mark.parametrize("batch_size", [(), (3,), (2, 3)])
def test_it_is_an_environment_as_torchrl_wants_it(batch_size: tuple[int, ...]) -> None:
    check_env_specs(SecureOffloadingEnv(Line(), batch_size=batch_size, diagnostics=True, seed=0))
    check_env_specs(make_env(FAMILY, batch_size=batch_size, fading=True, clock=True, seed=0))


def test_every_reset_gives_every_row_a_layout_of_its_own() -> None:
    env = make_env(FAMILY, batch_size=50, seed=0)
    first, second = env.reset()["ue_positions"], env.reset()["ue_positions"]
    both = torch.cat([first, second]).flatten(1)
    assert first.shape == (50, 6, 2)
    assert len(both.unique(dim=0)) == 100
    assert bool((first.norm(dim=-1) <= 45.0).all())


@pytest.mark.parametrize("family", [FAMILY, Line()], ids=["disk", "line"])
def test_a_layout_stays_for_an_episode_and_is_what_is_flown(family: Any) -> None:
    flown = make_env(family, batch_size=3, seed=1).rollout(4)
    for name in ("ue_positions", "legitimate_position", "eavesdropper_positions"):
        assert bool((flown["next", name] == flown[name][:, :1]).all())
        assert bool((flown[name] == flown[name][:, :1]).all())
    require_true_distances(flown)
    require_true_distances(flown["next"])


def test_equal_seeds_give_equal_layouts_whatever_else_is_drawn() -> None:
    env = make_env(FAMILY, batch_size=3, seed=5)
    expected = [env.reset()["ue_positions"] for _ in range(3)]
    torch.manual_seed(1)
    other, busy = make_env(FAMILY, batch_size=3), make_env(FAMILY, batch_size=2, seed=5)
    other.set_seed(5)
    for layout in expected:
        torch.rand(7)
        assert torch.equal(other.reset()["ue_positions"], layout)
        other.rollout(3, auto_reset=False, tensordict=other.fake_tensordict())  # slots draw nothing
        busy.rollout(2)


def test_a_rows_layouts_depend_on_its_own_seed_alone() -> None:
    together = make_env(FAMILY, batch_size=(3, 2), seed=[4, 9, 4])
    alone = make_env(FAMILY, batch_size=(1, 2), seed=[9])
    for _ in range(2):
        drawn = together.reset()["ue_positions"]
        assert torch.equal(drawn[0], drawn[2])
        assert torch.equal(drawn[1:2], alone.reset()["ue_positions"])
        assert same(drawn[0], drawn[1]) == [False, False]


def test_a_row_flies_as_over_the_same_layout_that_is_fixed() -> None:
    seeds = [3, 4, 5]
    drawn = make_env(FAMILY, batch_size=3, seed=seeds)
    state = drawn.reset()
    layouts = [
        dataclasses.replace(FAMILY.scenario, ue_positions=state["ue_positions"][row])
        for row in range(3)
    ]
    fixed = make_env(layouts, seed=seeds)
    other = fixed.reset()
    actions = 2 * torch.rand(4, 3, 2, generator=torch.Generator().manual_seed(0)) - 1
    for action in actions:
        state = drawn.step(state.set("action", action))["next"]
        other = fixed.step(other.set("action", action))["next"]
        for name in ("observation", "mode", "reward", "episode_reward"):
            torch.testing.assert_close(state[name], other[name], rtol=1e-4, atol=1e-5)
    assert bool((state["episode_reward"] > 0).any())


def test_only_the_rows_that_are_reset_get_another_layout() -> None:
    env = make_env(FAMILY, batch_size=4, seed=2)
    state = env.step(env.rand_action(env.reset()))["next"]
    rows = torch.tensor([[True], [False], [True], [False]])
    before = state["ue_positions"].clone()
    after = env.reset(state.clone().set("_reset", rows))
    assert same(before, after["ue_positions"]) == [False, True, False, True]
    assert torch.equal(after["observation"][1], state["observation"][1])
    require_true_distances(after)
    require_true_distances(env.step(env.rand_action(after))["next"])


def test_collectors_fly_over_a_new_layout_in_each_episode() -> None:
    env = make_env(FAMILY, batch_size=2, seed=0)
    collector = Collector(env, frames_per_batch=24, total_frames=24)
    (flown,) = collector
    layouts = flown["ue_positions"].unflatten(1, (3, 4))  # episodes of 4 slots
    assert bool((layouts == layouts[:, :, :1]).all())
    assert len(layouts[:, :, 0].flatten(0, 1).flatten(1).unique(dim=0)) == 6
    require_true_distances(flown)
    collector.shutdown()


def test_a_reset_starts_where_it_is_told_to() -> None:
    env = make_env(FAMILY, batch_size=2, seed=0)
    assert env.reset()["position"].tolist() == [[[-60.0, -60.0]]] * 2
    there = torch.tensor([[[1.0, 2.0]], [[3.0, 4.0]]])
    state = env.reset(TensorDict(position=there, batch_size=2))
    assert torch.equal(state["position"], there)
    require_true_distances(state)


def test_the_compiled_environment_draws_the_same_layouts() -> None:
    eager: Any = make_env(FAMILY, batch_size=4, seed=3)
    compiled: Any = make_env(FAMILY, batch_size=4, seed=3, compiled=True)
    expected, flown = fly_northeast(eager, 10), fly_northeast(compiled, 10)
    assert compiled._flight is not None
    assert torch.equal(flown["ue_positions"], expected["ue_positions"])
    whole, other = compiled.reset(), eager.reset()
    for name in ("ue_positions", "observation", "mode"):
        torch.testing.assert_close(whole[name], other[name], rtol=1e-4, atol=1e-5)
    for name in ("observation", "reward", "episode_reward"):
        found, wanted = flown["next", name], expected["next", name]
        torch.testing.assert_close(found, wanted, rtol=1e-4, atol=1e-4)


def test_gymnasium_gives_each_episode_a_layout_of_its_own() -> None:
    name = "hyuav/SecureOffloading-v0"
    env: Any = gymnasium.make(name, scenario=FAMILY, render_mode="rgb_array")
    first, _ = env.reset(seed=0)
    frame = env.render()
    second, _ = env.reset()
    assert not np.array_equal(first, second)
    assert not np.array_equal(frame, env.render())
    again, _ = env.reset(seed=0)
    assert np.array_equal(first, again)
    inner = env.unwrapped
    assert isinstance(inner, SecureOffloadingGymEnv)
    assert inner.observation_space.contains(again)


def test_rows_that_start_anew_within_a_step_get_another_layout() -> None:
    env = SecureOffloadingVectorEnv(3, FAMILY, autoreset_mode="SameStep", render_mode="rgb_array")
    env.reset(seed=0)
    seen = [env._flights.state["ue_positions"].clone()]
    still = np.zeros((3, 2), np.float32)
    for _ in range(4):
        *_, truncated, infos = env.step(still)
    assert truncated.all()
    seen.append(env._flights.state["ue_positions"].clone())
    assert same(*seen) == [False] * 3
    assert not np.array_equal(infos["final_obs"], env._flights.observation())
    mask = np.array([False, True, False])
    env.reset(options={"reset_mask": mask})
    after = env._flights.state["ue_positions"]
    assert same(seen[1], after) == [True, False, True]
    frames = env.render()
    assert frames is not None
    assert not np.array_equal(frames[0], frames[1])


@dataclasses.dataclass(frozen=True)
class TooFew(Line):
    def draw(self, draws: Tensor) -> Nodes:
        drawn = super().draw(draws)
        return drawn._replace(ue=drawn.ue[..., :4, :])


def test_a_generator_that_draws_other_numbers_of_nodes_is_refused() -> None:
    line = r"^scenario.draw\(\.\.\.\).ue = \(4, 2\): expected shape \(5, 2\)$"
    with pytest.raises(InputError, match=line):
        make_env(TooFew())


def test_families_may_be_of_any_layout() -> None:
    family = LayoutFamily(ClustersLayout(num_ues=9, num_clusters=3), SHORT)
    state = make_env(family, batch_size=2, seed=0).reset()
    assert state["ue_positions"].shape == (2, 9, 2)
    assert state["observation"].shape == (2, 14)
