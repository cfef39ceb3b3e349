import copy
import dataclasses
import pickle
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn

from batches import TEN_UES
from hyuav import InputError, Policy, RobustDDPG, Scenario, make_env, re_lt
from hyuav.learning.policy import learned_policy
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.weights import copy_weights

SCENARIO = Scenario.preset("two_clusters")
EVERY = pytest.mark.parametrize("name", sorted(ALGORITHMS))


def untrained(name: str, learners: tuple[int, ...] = (1,), scenario: Scenario = SCENARIO) -> Policy:
    algorithm = ALGORITHMS[name](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(3, scenario).loss)
    return learned_policy(scenario, algorithm, weights, learners)


@EVERY
@pytest.mark.parametrize("batch_size", [(), (4,), (2, 3)])
def test_a_policy_flies_any_batch_in_the_environment_that_it_makes(
    name: str, batch_size: tuple[int, ...]
) -> None:
    policy = untrained(name)
    flown = policy.make_env(batch_size=batch_size, seed=0).rollout(5, policy)
    assert flown["action"].shape == (*batch_size, 5, 2)
    assert not flown["action"].requires_grad


@EVERY
def test_the_environment_has_the_transforms_of_the_training(name: str) -> None:
    algorithm = ALGORITHMS[name]()
    own = untrained(name).make_env(batch_size=2, seed=3)
    clock, geofence = algorithm.clock, algorithm.geofence
    expected = make_env(SCENARIO, "hybrid", 2, seed=3, clock=clock, geofence=geofence)
    assert [type(each) for each in own.transform] == [type(each) for each in expected.transform]
    assert torch.equal(own.reset()["observation"], expected.reset()["observation"])


def test_what_is_asked_takes_the_place_of_what_was_in_training() -> None:
    shorter = dataclasses.replace(SCENARIO, num_slots=3)
    env = untrained("td3_robust").make_env(scenario=shorter, scheme="relay", batch_size=(4,))
    assert env.base_env.scenario == shorter
    assert (env.reset()["mode"] == 1).all()


MANY = dataclasses.replace(
    SCENARIO,
    helper_starts=((-60.0, -60.0), (50.0, 0.0)),
    eavesdropper_positions=((-70.0, -70.0), (70.0, 70.0), (0.0, 70.0)),
    power_control=True,
)


@pytest.mark.parametrize("name", ["ddpg", "td3", "sac", "maddpg"])
def test_a_policy_steers_several_helpers_and_their_power(name: str, tmp_path: Path) -> None:
    policy = untrained(name, scenario=MANY)
    flown = policy.make_env(batch_size=(3,), seed=0).rollout(4, policy)
    assert flown["action"].shape == (3, 4, 6)
    observed = flown["observation"]
    torch.testing.assert_close(policy.act(observed), flown["action"])
    policy.export(tmp_path / "policy.pt2")
    exported = torch.export.load(tmp_path / "policy.pt2").module()(observed[0])
    torch.testing.assert_close(exported, flown["action"][0])
    with pytest.raises(InputError, match=r"10 UEs, 3 eavesdropper\(s\), 2 helper\(s\) and"):
        policy.act(np.zeros(15))


def test_a_learner_acts_as_it_did_in_training() -> None:
    algorithm = ALGORITHMS["ddpg"](hidden_sizes=(8,))
    built = algorithm.build(3, TEN_UES)
    policy = learned_policy(SCENARIO, algorithm, copy_weights(built.loss), [1])
    observed = make_env(SCENARIO, batch_size=3).reset()
    expected = built.actor(observed.clone())["action"][1]
    torch.testing.assert_close(policy(observed.clone())["action"][1], expected)


def test_several_learners_fly_a_row_each() -> None:
    algorithm = ALGORITHMS["sac"](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(3, TEN_UES).loss)
    together = learned_policy(SCENARIO, algorithm, weights, [2, 0])
    observed = make_env(SCENARIO, batch_size=(2, 4)).reset()
    actions = together(observed.clone())["action"]
    for row, learner in enumerate([2, 0]):
        alone = learned_policy(SCENARIO, algorithm, weights, [learner])
        torch.testing.assert_close(actions[row], alone(observed[row].clone())["action"])
    with pytest.raises(InputError, match=r"observation = \(3, 15\): .* shape \(2, ..., 15\)"):
        together.act(torch.zeros(3, 15))


def test_an_actor_of_other_ues_is_refused() -> None:
    algorithm = ALGORITHMS["ddpg"](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, TEN_UES).loss)
    fewer = dataclasses.replace(SCENARIO, ue_positions=SCENARIO.ue_positions[:4])
    with pytest.raises(InputError, match="checkpoint"):
        learned_policy(fewer, algorithm, weights)


@EVERY
def test_an_observation_of_any_kind_is_answered_in_the_same_kind(name: str) -> None:
    policy = untrained(name)
    state = policy.make_env(batch_size=(2, 3), seed=1).reset()
    expected = policy(state.clone())["action"]
    observed = state["observation"]
    for tensor in (observed, observed.double(), observed.mT.contiguous().mT):
        assert torch.equal(policy.act(tensor), expected)
        assert torch.equal(policy(tensor), expected)
    array = observed.numpy()
    for own in (array, array.astype(np.float64), array.astype(">f4"), array.astype(np.longdouble)):
        action = policy.act(own)
        assert isinstance(action, np.ndarray)
        assert action.dtype == np.float32
        assert np.array_equal(action, expected.numpy())
    single = policy.act(array[1, 2])
    assert single.shape == (2,)
    np.testing.assert_allclose(single, expected[1, 2].numpy(), atol=1e-6)
    assert policy.act(array[:0]).shape == (0, 3, 2)
    half = policy.act(observed.bfloat16())
    torch.testing.assert_close(half, expected, atol=0.1, rtol=0.1)


@EVERY
def test_a_policy_keeps_to_the_devices_of_its_weights_and_of_what_is_observed(
    name: str, tmp_path: Path
) -> None:
    algorithm = ALGORITHMS[name](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(2, SCENARIO).loss)
    with torch.device("meta"):  # which holds no numbers
        policy = learned_policy(SCENARIO, algorithm, weights, [1])
        env = policy.make_env(batch_size=(3,), device="cpu", seed=0)
        flown = env.rollout(2, policy)
        policy.act(flown["observation"].numpy())
        policy.export(tmp_path / "policy.pt")
    assert flown["action"].isfinite().all()


def test_the_callers_default_type_changes_nothing() -> None:
    algorithm = ALGORITHMS["sac_robust"](hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, SCENARIO).loss)
    observed = np.full((3, 16), 0.25)
    expected = learned_policy(SCENARIO, algorithm, weights).act(observed)
    torch.set_default_dtype(torch.float64)
    try:
        action = learned_policy(SCENARIO, algorithm, weights).act(observed)
    finally:
        torch.set_default_dtype(torch.float32)
    assert action.dtype == np.float32
    assert np.array_equal(action, expected)


def test_a_policy_predicts_as_stable_baselines3_asks() -> None:
    policy = untrained("td3")
    observed = policy.make_env(batch_size=4, seed=0).reset()["observation"].numpy()
    started = np.ones(4, bool)
    action, state = policy.predict(observed, None, started, deterministic=True)
    assert np.array_equal(action, policy.act(observed))
    assert state is None
    kept = (np.zeros(3),)
    assert policy.predict(observed[0], kept)[1] is kept


WRONG: dict[str, tuple[Any, str]] = {
    "without the clock": (np.zeros((3, 15)), r"observation = \(3, 15\): .*\(\.\.\., 16\).* 10 UEs"),
    "of other UEs": (torch.zeros(14), r"observation = \(14,\)"),
    "nothing": (None, "observation = None"),
    "a single number": (torch.tensor(0.5), r"observation = \(\)"),
    "an array without axes": (np.array(0.5), r"observation = \(\)"),
    "a list": ([0.0] * 16, r"observation = \[0.0, "),
    "a dictionary": ({"observation": np.zeros(16)}, "observation = {"),
    "whole numbers": (torch.zeros(16, dtype=torch.int64), r"observation = torch\.int64"),
    "truth values": (np.zeros(16, bool), r"observation = dtype\('bool'\)"),
    "complex numbers": (np.zeros(16, complex), r"observation = dtype\('complex128'\)"),
    "words": (np.array(["a"] * 16), r"observation = dtype\('<U1'\)"),
    "objects": (np.array([None] * 16), r"observation = dtype\('O'\)"),
    "a sparse tensor": (torch.eye(16).to_sparse(), r"observation = tensor\(indices="),
    "NaN": (np.full(16, np.nan), r"observation = \[nan, "),
    "infinity": (torch.full((2, 16), torch.inf), r"observation = \[\[inf, "),
    "too large a number": (np.full(16, 1e300), r"observation = \[1e\+300, "),
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_observation_is_answered_in_one_line(kind: str) -> None:
    policy, (observation, line) = untrained("ddpg_robust"), WRONG[kind]
    methods: list[Callable[[Any], Any]] = [policy.act, policy.predict, policy]
    for method in methods:
        with pytest.raises(InputError, match=line) as refused:
            method(observation)
        assert re.fullmatch(
            r".*: expected finite floating-point numbers of shape .*clock=True.*",
            (str(refused.value)),
        )


@pytest.mark.parametrize(
    ("entries", "line"),
    [
        ({"position": torch.zeros(3, 1, 2)}, "observation = None: expected"),
        ({"observation": torch.full((3, 15), torch.nan)}, r"observation = \[\[nan, "),
        ({"observation": TensorDict(batch_size=(3,))}, "observation = None: expected"),
    ],
)
def test_entries_that_do_not_fit_are_refused(entries: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line):
        untrained("ddpg")(TensorDict(entries, batch_size=(3,)))


def test_an_environment_without_the_clock_is_refused() -> None:
    policy = untrained("sac_robust")
    with pytest.raises(InputError, match=r"observation = \(2, 15\): .* clock=True"):
        make_env(SCENARIO, batch_size=2, geofence=True).rollout(3, policy)


def test_another_number_of_ues_is_seen_behind_an_observation_of_the_same_size() -> None:
    fewer = dataclasses.replace(SCENARIO, ue_positions=SCENARIO.ue_positions[1:])
    policy = untrained("td3_robust", scenario=fewer)
    with pytest.raises(InputError, match=r"observation = \(2, 15\): .* 9 UEs, .* clock=True"):
        make_env(SCENARIO, batch_size=2).rollout(3, policy)


class Leaving(nn.Module):
    """Fly to the map's corner and beyond."""

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return -torch.ones_like(observation[..., :2])


def test_an_environment_without_the_geofence_is_told_where_it_is_felt() -> None:
    policy = Policy(Leaving(), SCENARIO, geofence=True)
    with pytest.warns(UserWarning, match=r"trained with geofence=True: policy\.make_env"):
        make_env(SCENARIO, batch_size=2).rollout(6, policy)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        policy.make_env(batch_size=2).rollout(6, policy)
        unfenced = Policy(Leaving(), SCENARIO)
        assert make_env(SCENARIO, batch_size=2).rollout(6, unfenced)["next", "off_map"].any()


@pytest.mark.parametrize(
    "wrap",
    [
        lambda own: own,
        lambda own: TensorDictModule(own, in_keys=["observation"], out_keys=["action"]),
    ],
)
def test_a_network_of_ones_own_becomes_a_policy(wrap: Callable[[nn.Module], nn.Module]) -> None:
    network = nn.Sequential(nn.Linear(16, 2), nn.Tanh())
    policy = Policy(wrap(network), "two_clusters", "relay", clock=True)
    assert policy.environment == {
        "scenario": SCENARIO,
        "scheme": "relay",
        "clock": True,
        "geofence": False,
    }
    flown = policy.make_env(batch_size=(2, 3)).rollout(2, policy)
    torch.testing.assert_close(flown["action"], network(flown["observation"]))
    observed = torch.rand(16)
    assert policy(observed).requires_grad
    assert not policy.act(observed).requires_grad


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"network": "policy.pt"}, r"network = 'policy.pt': expected a torch\.nn\.Module"),
        ({"network": re_lt(SCENARIO)}, "network = 'ConstantVelocity': expected a module that re"),
        ({"scenario": "nowhere"}, "nowhere"),
        ({"scheme": "both"}, "scheme = 'both': expected one of"),
        ({"clock": "yes"}, "clock = 'yes': expected true or false"),
        ({"geofence": 1}, "geofence = 1: expected true or false"),
        ({"learners": 0}, "learners = 0: expected a whole number >= 1"),
    ],
)
def test_a_policy_of_something_else_is_refused(arguments: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line):
        Policy(**{"network": nn.Linear(15, 2), "scenario": SCENARIO, **arguments})


def test_a_policy_can_be_copied_and_sent_to_another_process(tmp_path: Path) -> None:
    policy = untrained("sac_robust")
    observed = torch.rand(3, 16)
    torch.save(policy, tmp_path / "policy")
    for other in (
        copy.deepcopy(policy),
        pickle.loads(pickle.dumps(policy)),
        torch.load(tmp_path / "policy", weights_only=False),
    ):
        assert other.environment == policy.environment
        assert torch.equal(other.act(observed), policy.act(observed))


@EVERY
def test_pytorch_exports_a_policy(name: str) -> None:
    policy = untrained(name)
    size = 16 if policy.environment["clock"] else 15
    batch = ({0: torch.export.Dim("batch")},)
    program = torch.export.export(policy, (torch.zeros(2, size),), dynamic_shapes=batch).module()
    for rows in (1, 2, 7):
        observed = torch.rand(rows, size)
        torch.testing.assert_close(program(observed), policy.act(observed))


def test_a_slot_of_a_learned_policy_is_one_graph_that_is_made_once() -> None:
    algorithm = RobustDDPG(hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, TEN_UES).loss)
    policy = learned_policy(TEN_UES, algorithm, weights)
    flown = []
    for compiled in (False, True):
        observed: dict[str, Any] = algorithm.environment
        env = make_env(TEN_UES, batch_size=3, seed=1, **observed)

        def fly_slot(state: Any, env: Any = env) -> Any:
            return env.step_mdp(env.step(policy(state)))

        state = fly_slot(env.reset())
        if compiled:
            fly_slot = torch.compile(fly_slot, fullgraph=True, backend="eager")
        for slot in range(4):
            with torch.compiler.set_stance("fail_on_recompile" if slot > 0 else "default"):
                state = fly_slot(state)
        flown.append(state["episode_reward"])
    torch.testing.assert_close(*flown)
