"""Each helper as an agent of its own, in TorchRL's grouping."""

import dataclasses
from typing import Any

import pytest
import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torchrl.collectors import Collector
from torchrl.envs.utils import check_env_specs, check_marl_grouping
from torchrl.modules import MultiAgentMLP
from torchrl.objectives import DDPGLoss

from hyuav import InputError, Scenario, make_env
from hyuav.envs.observation import ObservationLayout

THREE = dataclasses.replace(
    Scenario.preset("two_clusters"),
    helper_starts=((-60.0, -60.0), (60.0, -60.0), (0.0, 20.0)),
    eavesdropper_positions=((80.0, 80.0), (-80.0, 60.0)),
    num_slots=4,
)
ONE = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=4)
ALL = {"clock": True, "geofence": True, "diagnostics": True, "fading": True}


@pytest.mark.parametrize("batch_size", [(), (3,)])
@pytest.mark.parametrize("options", [{}, ALL])
@pytest.mark.parametrize("power_control", [False, True])
def test_the_specs_hold_and_name_the_group(
    batch_size: tuple[int, ...], options: dict[str, Any], power_control: bool
) -> None:
    scenario = dataclasses.replace(THREE, power_control=power_control)
    env = make_env(scenario, batch_size=batch_size, seed=0, agents=True, **options)
    check_env_specs(env, seed=0)
    assert env.group_map == {"helpers": ["helper_0", "helper_1", "helper_2"]}
    check_marl_grouping(env.group_map, env.group_map["helpers"])
    assert env.action_keys == [("helpers", "action")]
    assert env.reward_keys == [("helpers", "reward")]
    flown = env.rollout(4)
    before, after = flown["helpers"], flown["next", "helpers"]
    assert before.batch_size == after.batch_size == (*batch_size, 4, 3)
    assert before["action"].shape[-1] == (3 if power_control else 2)
    assert before["observation"].shape[-1] == 3 + 13 + 2 * 3 + ("clock" in options)
    for name in ("reward", "done", "terminated", "truncated"):
        assert after[name].shape[-1] == 1
    assert not hasattr(make_env(scenario), "group_map")


def test_agents_fly_as_one_joint_learner_does() -> None:
    grouped = make_env(THREE, batch_size=5, seed=3, agents=True)
    joint = make_env(THREE, batch_size=5, seed=3)
    shared, own = grouped.reset(), joint.reset()
    generator = torch.Generator().manual_seed(0)
    for _ in range(THREE.num_slots):
        action = 2 * torch.rand(5, 3, 2, generator=generator) - 1
        shared["helpers", "action"], own["action"] = action, action.flatten(-2)
        flown, same = grouped.step(shared), joint.step(own)
        for name in ("reward", "done", "terminated", "truncated"):
            expected = same["next", name].unsqueeze(-2).expand(5, 3, 1)
            assert torch.equal(flown["next", "helpers", name], expected), name
        for name in ("observation", "episode_reward", "done", "truncated"):
            assert torch.equal(flown["next", name], same["next", name]), name
        assert flown["next"].get("reward", None) is None
        shared, own = grouped.step_mdp(flown), joint.step_mdp(same)
    assert (own["episode_reward"] > 0.0).any()
    assert shared["helpers", "truncated"].all()


def test_an_agent_observes_itself_first_and_then_the_others_in_a_circle() -> None:
    env = make_env(THREE, "rjr", batch_size=2, seed=0, agents=True, clock=True)
    after = env.rollout(3)["next"]
    place, lengths = after["position"] / 100.0, after["distances"] / 100.0 - 1.0
    mode = after["mode"].float().unsqueeze(-1) * 2.0 - 1.0
    clock = after["step_count"] / 2.0 - 1.0
    for own, others in ((0, (1, 2)), (1, (2, 0)), (2, (0, 1))):
        known = [(place[..., i, :], mode[..., i, :]) for i in others]
        parts = [place[..., own, :], mode[..., own, :], lengths[..., own, :]]
        expected = torch.cat([*parts, *(part for pair in known for part in pair), clock], dim=-1)
        torch.testing.assert_close(after["helpers", "observation"][..., own, :], expected)


@pytest.mark.parametrize("clock", [False, True])
def test_a_lone_agent_observes_what_one_learner_does(clock: bool) -> None:
    layout = ObservationLayout(ONE, clock=clock)
    observation = torch.randn(2, 3, layout.size)
    assert torch.equal(layout.of_each(observation), observation.unsqueeze(-2))


def test_an_action_of_another_shape_is_refused() -> None:
    env = make_env(THREE, seed=0, agents=True)
    state = env.reset()
    state["helpers", "action"] = torch.zeros(3, 3)
    with pytest.raises(InputError, match=r"^action = \(3, 3\): expected shape \(3, 2\)$"):
        env.step(state)


@pytest.mark.parametrize("share_params", [False, True])
def test_networks_collector_and_loss_of_torchrl_take_the_group(share_params: bool) -> None:
    env = make_env(THREE, batch_size=2, seed=0, agents=True)
    size = env.observation_spec["helpers", "observation"].shape[-1]

    def network(inputs: int, outputs: int, *, centralized: bool) -> torch.nn.Module:
        return MultiAgentMLP(inputs, outputs, 3, centralized=centralized, share_params=share_params)

    actor = TensorDictModule(
        torch.nn.Sequential(network(size, 2, centralized=False), torch.nn.Tanh()),
        in_keys=[("helpers", "observation")],
        out_keys=[("helpers", "action")],
    )
    joined = TensorDictModule(
        lambda *parts: torch.cat(parts, dim=-1),
        in_keys=[("helpers", "observation"), ("helpers", "action")],
        out_keys=[("helpers", "joined")],
    )
    valued = TensorDictModule(
        network(size + 2, 1, centralized=True),
        in_keys=[("helpers", "joined")],
        out_keys=[("helpers", "state_action_value")],
    )
    loss = DDPGLoss(actor, TensorDictSequential(joined, valued), delay_value=True)
    loss.set_keys(
        state_action_value=("helpers", "state_action_value"),
        **{name: ("helpers", name) for name in ("reward", "done", "terminated")},
    )
    loss.make_value_estimator(gamma=0.95)
    collector = Collector(
        env, actor, frames_per_batch=16, total_frames=16, auto_register_policy_transforms=False
    )
    (batch,) = list(collector)
    losses = loss(batch.reshape(-1))
    (losses["loss_actor"] + losses["loss_value"]).backward()
    assert all(weight.grad is not None for weight in loss.parameters())
    collector.shutdown()
