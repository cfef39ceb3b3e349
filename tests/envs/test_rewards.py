"""What a slot earns is the researcher's: a function of its outcome, or a transform."""

import dataclasses
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import RewardScaling, Transform
from torchrl.envs.utils import check_env_specs

from hyuav import InputError, InputTypeError, Reward, Scenario, SecureOffloadingEnv, make_env
from hyuav.envs.rewards import FAIR_RATE, REWARDS, as_reward
from hyuav.physics.outcome import SlotOutcome

TWO_CLUSTERS = Scenario.preset("two_clusters")
COMING_WITH_IT = ["secrecy_energy_efficiency", "proportional_fairness"]


def served(slot: SlotOutcome) -> Tensor:
    return slot.offloading.float().mean(dim=-1, keepdim=True)


class Served(Transform):
    """The same of what the environment gives beside."""

    def __init__(self, _: Scenario) -> None:
        super().__init__(in_keys=["offloading"], out_keys=["reward"])

    def _step(self, _: TensorDictBase, after: TensorDictBase) -> TensorDictBase:
        after["reward"] = after["offloading"].float().mean(dim=-1, keepdim=True)
        return after


def flown(slots: int = 20, scheme: Any = "hybrid", **options: Any) -> TensorDictBase:
    """Flights from the corner over the map, in slots (..., T)."""
    env = make_env(
        TWO_CLUSTERS, scheme, **{"batch_size": 3, "seed": 0, "geofence": True, **options}
    )
    wind = torch.tensor([0.7, 0.3]).expand(env.action_spec.shape)
    return env.rollout(slots, lambda td: td.set("action", wind))


@pytest.mark.parametrize("batch_size", [(), (2, 3)])
@pytest.mark.parametrize("reward", [*COMING_WITH_IT, served, Served, RewardScaling(0.0, 2.0)])
def test_the_specs_hold(batch_size: tuple[int, ...], reward: Any) -> None:
    env = make_env(TWO_CLUSTERS, batch_size=batch_size, seed=0, reward=reward, diagnostics=True)
    check_env_specs(env)


def test_by_default_it_is_the_secrecy_sum_rate() -> None:
    plain, named = flown(), flown(reward="sum_rate")
    assert set(plain.keys(True, True)) == set(named.keys(True, True))
    assert (plain["next", "reward"] == named["next", "reward"]).all()
    other = flown(reward=served)
    assert (other["next", "sum_rate"] == plain["next", "reward"]).all()  # which stands beside


def test_energy_efficiency_divides_by_all_that_flies_and_sends() -> None:
    after = flown(
        scheme=["hybrid", "relay", "jamming"], diagnostics=True, reward=COMING_WITH_IT[0]
    )["next"]
    found = after["diagnostics"]
    of_ues = (found["ue_energy"] * found["offloading"]).sum(dim=-1, keepdim=True)
    expected = after["sum_rate"] / (found["helper_energy"] + of_ues)
    assert after["reward"].max() > 0.0
    torch.testing.assert_close(after["reward"], expected)


def test_a_slot_that_takes_no_energy_earns_nothing() -> None:
    env = make_env(
        TWO_CLUSTERS, "relay", seed=0, reward=COMING_WITH_IT[0]
    )  # nobody is in reach of the corner
    after = env.step(env.reset().set("action", torch.zeros(2)))["next"]
    assert after["reward"] == 0.0


def test_an_episode_of_proportional_fairness_earns_the_objective() -> None:
    after = flown(reward="proportional_fairness", diagnostics=True)["next"]
    mean = after["diagnostics", "secrecy_rate"].double().mean(dim=1)
    expected = torch.log1p(mean / FAIR_RATE).sum(dim=-1)
    assert (expected > 1.0).all()
    torch.testing.assert_close(after["episode_reward"][:, -1, 0].double(), expected)


def test_fairness_begins_anew_in_the_rows_that_are_reset() -> None:
    last = flown(slots=12, reward="proportional_fairness")["next"][:, -1]
    assert (last["accumulated_rate"].sum(dim=-1) > 0.0).all()
    env = make_env(TWO_CLUSTERS, batch_size=3, seed=0, reward="proportional_fairness")
    rows = torch.tensor([True, False, True])
    env.reset()
    again = env.reset(last.exclude("reward").set("_reset", rows.unsqueeze(-1)))
    assert (again["accumulated_rate"][rows] == 0.0).all()
    assert (again["accumulated_rate"][1] == last["accumulated_rate"][1]).all()


def test_a_function_and_a_transform_may_say_the_same() -> None:
    function, transform = flown(reward=served), flown(reward=Served)
    assert function["next", "reward"].max() > 0.0
    assert (function["next", "reward"] == transform["next", "reward"]).all()


class Late(Served):
    """Read what the other transforms keep."""

    def _step(self, before: TensorDictBase, after: TensorDictBase) -> TensorDictBase:
        after["reward"] = 1.0 * (before["step_count"] + 1)
        return after


def test_a_transform_may_read_what_the_others_keep() -> None:
    after = flown(slots=4, reward=Late)["next"]
    assert after["reward"][0].flatten().tolist() == [1.0, 2.0, 3.0, 4.0]


def test_one_transform_serves_several_environments() -> None:
    doubled = RewardScaling(0.0, 2.0)
    several = [flown(reward=doubled)["next", "reward"] for _ in range(2)]
    for found in several:
        torch.testing.assert_close(found, 2.0 * flown()["next", "reward"])


def test_whoever_leaves_the_map_pays_the_penalty_in_the_unit_of_the_objective() -> None:
    env = make_env(TWO_CLUSTERS, "relay", seed=0, reward=served)
    after = env.step(env.reset().set("action", torch.tensor([-1.0, -1.0])))["next"]
    after = env.step(after.set("action", torch.tensor([-1.0, -1.0])))["next"]
    after = env.step(after.set("action", torch.tensor([-1.0, -1.0])))["next"]
    assert after["off_map"].item()
    assert after["reward"].item() == pytest.approx(-0.2)


def flights_far(slot: SlotOutcome) -> Tensor:
    return slot.sum_rate * slot.control.velocity.square().sum(dim=-1)


def unpacked(slot: SlotOutcome) -> Tensor:
    nodes, *_ = slot
    return nodes.helper.norm(dim=-1)


@pytest.mark.parametrize(
    ("reward", "expected"),
    [
        ("sum_rate", "position"),
        ("secrecy_energy_efficiency", "velocity"),
        ("proportional_fairness", "episode"),
        (served, "position"),
        (flights_far, "velocity"),
        (lambda slot: slot.flight_energy, "velocity"),
        (unpacked, "velocity"),  # which may have read it
        (Served, "episode"),
        (Reward(Served, depends_on="position"), "position"),
        (Reward(flights_far, depends_on="episode"), "episode"),
    ],
)
def test_what_a_reward_depends_on_is_found_or_declared(reward: Any, expected: str) -> None:
    assert make_env(TWO_CLUSTERS, reward=reward).base_env.reward.depends_on == expected
    assert as_reward(reward).dependence(TWO_CLUSTERS) == expected


def raises(slot: SlotOutcome) -> Tensor:
    return slot.energy  # type: ignore[attr-defined]


class Failing(Served):
    def _step(self, _: TensorDictBase, after: TensorDictBase) -> TensorDictBase:
        return after.set("reward", after["gone"])


class Demanding(Served):
    def __init__(self) -> None:
        raise AssertionError


@pytest.mark.parametrize(
    ("reward", "line"),
    [
        ("sumrate", r"reward = 'sumrate': .*\(did you mean 'sum_rate'\?\)"),
        ("own.py:gone", r"reward = 'own.py:gone': expected a reward of a file that you name"),
        (3, r"reward = 3: expected a function of a slot's outcome .*, or a transform"),
        (lambda slot: slot.sum_rate.mean(), r"numbers, not \(\) where slots are \(2, 49\)"),
        (lambda slot: slot.sum_rate.squeeze(-1), r"numbers, not \(2, 49\) where"),
        (lambda _: 1.0, "numbers, not float"),
        (lambda slot: slot.offloading.any(-1, keepdim=True), "numbers, not torch.bool"),
        (lambda slot: slot.sum_rate / slot.flight_energy, "numbers, not nan"),
        (raises, r"'raises': .*\(test_rewards.py, line \d+: AttributeError: 'SlotOutcome'"),
        (Failing, r"'Failing': expected a transform .*\(test_rewards.py, line \d+: KeyError"),
        (Demanding, "'Demanding': expected a class of transforms that takes the scenario"),
        (RewardScaling(float("nan"), 1.0), "'RewardScaling': .*, not nan"),
    ],
)
def test_what_is_no_reward_is_told_in_one_line(reward: Any, line: str) -> None:
    with pytest.raises(InputError, match=f"^reward = [^\n]*{line.removeprefix('reward = ')}"):
        make_env(TWO_CLUSTERS, reward=reward)


def test_the_environment_below_takes_functions_alone() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, reward="secrecy_energy_efficiency")
    assert env.rollout(2)["next", "sum_rate"].shape == (2, 1)
    with pytest.raises(InputError, match="a transform is for make_env"):
        SecureOffloadingEnv(TWO_CLUSTERS, reward="proportional_fairness")
    with pytest.raises(InputError, match="depends_on = 'weather': expected one of position,"):
        Reward(served, depends_on="weather")
    with pytest.raises(InputTypeError, match="reward = 3"):
        Reward(3)


def test_gymnasium_tells_the_sum_rate_beside_it(build: Callable[..., Any]) -> None:
    plain, other = build(), build(reward=served)
    for env in (plain, other):
        env.reset(seed=0)
    for _ in range(10):
        action = np.full(plain.action_space.shape, 0.6, np.float32)
        earned, told = (env.step(action) for env in (plain, other))
    assert earned[4]["secrecy_sum_rate"] == pytest.approx(told[4]["secrecy_sum_rate"])
    assert np.all(np.asarray(told[1]) <= 1.0)
    assert gymnasium.make("hyuav/SecureOffloading-v0", reward="proportional_fairness").reset()


def test_fairness_begins_anew_where_gymnasium_starts_an_episode() -> None:
    still = dataclasses.replace(TWO_CLUSTERS, fading=False, num_slots=6)
    start = dataclasses.replace(still, helper_starts=((-40.0, 0.0),))
    envs = gymnasium.make_vec(
        "hyuav/SecureOffloading-v0",
        2,
        scenario=start,
        reward="proportional_fairness",
        autoreset_mode="SameStep",
    )
    envs.reset(seed=0)
    hover = np.zeros((2, 2), np.float32)
    earned = np.stack([envs.step(hover)[1] for _ in range(12)])
    assert (earned > 0.0).all()
    np.testing.assert_allclose(earned[:6], earned[6:])
    assert (earned[0] > earned[1]).all()  # what a UE gets first counts most


def test_an_installed_package_offers_its_reward_by_an_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kind_package.py").write_text("def kind(slot):\n    return slot.sum_rate + 1.0\n")
    metadata = tmp_path / "kind_package-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Name: kind-package\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[hyuav.rewards]\nkind = kind_package:kind\n")
    monkeypatch.syspath_prepend(tmp_path)
    try:
        assert flown(slots=1, reward="kind")["next", "reward"].min() >= 1.0
        assert as_reward("kind").name == "kind"
    finally:
        REWARDS.pop("kind", None)
        sys.modules.pop("kind_package", None)


@pytest.mark.parametrize("reward", [*REWARDS.values(), Reward(served, unit="share")])
def test_another_process_is_sent_it(reward: Reward) -> None:
    assert pickle.loads(pickle.dumps(reward)) == reward


def test_the_nodes_of_each_row_may_stand_elsewhere() -> None:
    scenarios = [TWO_CLUSTERS, Scenario.preset("random_disk"), TWO_CLUSTERS]
    for reward in COMING_WITH_IT:
        env = make_env(scenarios, ["relay", "jamming", "hybrid"], 3, seed=0, reward=reward)
        assert env.rollout(3)["next", "reward"].isfinite().all()
