"""What a critic sees of where an action leads."""

import dataclasses

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav import Scenario, make_env
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.ddpg import DDPG

SCENARIO = Scenario.preset("two_clusters")


@given(
    start=st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)),
    action=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    limit=st.sampled_from(["box", "disc"]),
    geofence=st.booleans(),
    clock=st.booleans(),
)
def test_it_is_what_the_environment_brings(
    start: tuple[float, float], action: tuple[float, float], limit: str, geofence: bool, clock: bool
) -> None:
    scenario = dataclasses.replace(SCENARIO, speed_limit=limit)
    env = make_env(scenario, "relay", (1,), seed=0, clock=clock, geofence=geofence)
    state = env.reset(env.reset().select("position").set("position", torch.tensor([[start]])))
    state["action"] = torch.tensor([action])
    afterstate = Afterstate(scenario, 0.02, clock=clock, geofence=geofence)
    features = afterstate(state["observation"], state["action"])
    after = env.step(state)["next"]
    assert features.shape == (1, afterstate.size)
    num_ues = scenario.num_ues
    if not after["off_map"] and after["position"].abs().max() > 99.9:
        return  # the edge itself belongs to the map or not by rounding
    torch.testing.assert_close(
        features[:, : num_ues + 4],
        torch.cat([after["position"] / 100.0, after["distances"] / 100.0 - 1.0], dim=-1)[:, 0],
        rtol=0.0,
        atol=1e-4,
    )
    covered, beside = features[:, num_ues + 4 : -1 - clock], features[:, 2 * num_ues + 4]
    apart = (after["distances"][:, 0, :num_ues] - scenario.coverage_radius).abs() > 0.1
    inside = after["distances"][:, 0, :num_ues] < scenario.coverage_radius
    assert torch.equal(covered[apart] > 0.0, inside[apart])
    assert bool(beside > 0.0) == bool(after["off_map"])
    if clock:
        assert features[0, -1] == state["observation"][0, -1]


@pytest.mark.parametrize("power_control", [False, True])
def test_it_is_what_the_environment_brings_several_helpers(power_control: bool) -> None:
    starts = ((-60.0, -60.0), (70.0, 97.0), (0.0, 30.0))
    scenario = dataclasses.replace(
        *(SCENARIO,), helper_starts=starts, power_control=power_control, speed_limit="disc"
    )
    env = make_env(scenario, "hybrid", (50,), seed=0, clock=True)
    state = env.rand_action(env.reset())
    afterstate = Afterstate(scenario, 0.02, clock=True, geofence=False)
    features = afterstate(state["observation"], state["action"])
    after = env.step(state)["next"]
    assert features.shape == (50, afterstate.size)
    assert 0 < after["off_map"].sum() < 50
    covering = after["distances"][..., :10] < scenario.coverage_radius
    assert torch.equal(afterstate.coverage(features) > 0.5, covering.flatten(-2))
    shown = features.split((6, 36, 30, 3, 3 * power_control, 1), dim=-1)
    expected = [
        after["position"].flatten(-2) / 100.0,
        after["distances"].flatten(-2) / 100.0 - 1.0,
        shown[2],
        after["off_map"] * 2.0 - 1.0,
        state["action"][:, 2::3] if power_control else shown[4],
        state["observation"][:, -1:],
    ]
    for own, brought in zip(shown, expected, strict=True):
        torch.testing.assert_close(own, brought, rtol=0.0, atol=1e-4)
    place = afterstate.layout.place(env.step(state))
    known = afterstate.at(place, state["observation"][:, -1:])
    torch.testing.assert_close(known[:, :72], features[:, :72], rtol=0.0, atol=1e-4)


def test_a_gradient_leads_into_the_coverage() -> None:
    position = torch.tensor([26.0 + 46.0, -16.0])  # one metre outside that of a UE
    action = torch.zeros(1, 2, requires_grad=True)
    observation = torch.cat([position / 100.0, torch.zeros(13)]).unsqueeze(0)
    features = Afterstate(SCENARIO, 0.02, clock=False, geofence=False)(observation, action)
    ue = SCENARIO.ue_positions.index((26.0, -16.0))
    coverage = features[0, SCENARIO.num_ues + 4 + ue]
    assert -0.5 < coverage.item() < 0.0
    coverage.backward()
    assert action.grad is not None
    assert action.grad[0, 0] < -1.0


@pytest.mark.parametrize("clock", [False, True])
def test_a_critic_values_alike_what_leads_to_the_same_place(clock: bool) -> None:
    torch.manual_seed(0)
    parameters = DDPG(hidden_sizes=(8,), afterstate=True, clock=clock)
    critic = parameters.make_critic(2, SCENARIO).module
    observation = torch.zeros(2, 3, 15 + clock)
    action = torch.zeros(2, 3, 2)
    observation[..., 0], action[..., 0] = torch.tensor([0.0, 0.1, 0.2]), torch.tensor([1, 0.5, 0])
    values = critic(observation, action)
    assert values.shape == (2, 3, 1)
    torch.testing.assert_close(values, values[:, :1].expand(2, 3, 1))
    assert not torch.allclose(critic(observation, -action), values)
    assert not torch.allclose(values[0], values[1])  # learners differ
