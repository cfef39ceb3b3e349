"""The compiled slots against the eager ones, and the change from one to the other."""

import copy
import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from hyuav import InputError, Scenario
from hyuav.envs.rewards import as_reward
from hyuav.learning import training as training_module
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.torchrl_internals import next_observation
from hyuav.learning.train import Cohort
from hyuav.learning.training import Training, TrainingParameters
from hyuav.physics.modes import MODE_RULES

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=5)
FADELESS = dataclasses.replace(SCENARIO, fading=False, edge_energy_budget=8.0, speed_limit="disc")
TWO_HELPERS = dataclasses.replace(SCENARIO, helper_starts=((-60.0, -60.0), (60.0, -60.0)))
LEARNERS = [Learner("hybrid", 1), Learner("relay", 2), Learner("jamming", 3)]
SMALL: dict[str, Any] = {"replay_size": 30, "batch_size": 8}
"""So that most tests here ask for the same program, which is compiled once."""
CASES = [
    ("ddpg", SCENARIO, "sum_rate"),
    ("ddpg_robust", SCENARIO, "sum_rate"),
    pytest.param("ddpg", FADELESS, "sum_rate", marks=pytest.mark.slow),
    pytest.param("td3", SCENARIO, "sum_rate", marks=pytest.mark.slow),
    pytest.param("ddpg", SCENARIO, "proportional_fairness", marks=pytest.mark.slow),
    pytest.param("ddpg_robust", SCENARIO, "secrecy_energy_efficiency", marks=pytest.mark.slow),
    ("td3", FADELESS, "sum_rate"),
    pytest.param("td3_robust", FADELESS, "sum_rate", marks=pytest.mark.slow),
    pytest.param("sac", SCENARIO, "sum_rate", marks=pytest.mark.slow),
    pytest.param("sac_robust", SCENARIO, "sum_rate", marks=pytest.mark.slow),
    pytest.param("sac", FADELESS, "sum_rate", marks=pytest.mark.slow),
    pytest.param("maddpg", TWO_HELPERS, "sum_rate", marks=pytest.mark.slow),
]


GUESS = "guide.reward_model.guess"
"""Decided by rounding where less is remembered than there are features, as here; so it is not
compared, and no flight is imagined that it would choose."""


def cohort(
    name: str, scenario: Scenario = SCENARIO, reward: str = "sum_rate", **changes: Any
) -> Cohort:
    guide = Guide(warm_up_episodes=3, update_every=2, repeat_every=2, imagined_flights=0)
    short: dict[str, Any] = {"hidden_sizes": (12,)}
    if name.endswith("robust"):
        short = {"hidden_sizes": (12, 8), "guide": guide}
    if reward == "secrecy_energy_efficiency":
        short["afterstate"] = False
    return Cohort(
        scenario,
        LEARNERS,
        ALGORITHMS[name](**short),
        device=None,
        reward=as_reward(reward),
        **(SMALL | changes),
    )


def tensors(trained: Cohort) -> dict[str, torch.Tensor]:
    """Everything that a slot changes."""
    found = dict(trained.algorithm.modules.state_dict())
    for step in trained.algorithm.steps:
        for index, state in enumerate(step.optimizer.state_dict()["state"].values()):
            found |= {f"{step.name}.{index}.{key}": values for key, values in state.items()}
    found |= {str(key): values for key, values in trained.replay[:].items(True, True)}
    carrier = next_observation(trained.collector)
    for stream, state in trained.state_dict()["random"].items():
        found[f"drawn from {stream}"] = torch.tensor(state["drawn"])
    found |= {f"carrier.{key}": carrier[key] for key in ("observation", "mode", "step_count")}
    return {
        name: values.clone().nan_to_num()  # NaN where no flight is planned
        for name, values in found.items()
        if isinstance(values, torch.Tensor) and name != GUESS
    }


def assert_agree(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> None:
    assert one.keys() == other.keys()
    for name, values in one.items():
        torch.testing.assert_close(other[name], values, rtol=2e-3, atol=2e-5, msg=name)


@pytest.mark.parametrize(("name", "scenario", "reward"), CASES)
def test_compiled_slots_are_the_eager_ones_up_to_rounding(
    name: str, scenario: Scenario, reward: str
) -> None:
    torch.manual_seed(0)
    eager, other = (cohort(name, scenario, reward) for _ in range(2))
    for trained in (eager, other):
        for _ in range(2):
            trained.fly()
    assert other.learns
    before = tensors(other)
    other.compile()
    after = tensors(other)
    assert all(torch.equal(before[key], after[key]) for key in before)  # recording does nothing
    for _ in range(9):  # beyond the end of the replay
        earned, losses, _ = eager.fly()
        other_earned, other_losses, _ = other.fly()
        torch.testing.assert_close(other_earned, earned, rtol=1e-3, atol=1e-4)
        torch.testing.assert_close(other_losses, losses, rtol=1e-2, atol=1e-4)
        assert_agree(tensors(eager), tensors(other))
    assert (other.episode, other.updates) == (eager.episode, eager.updates)
    other._compiled = None  # and from the compiled path back to the eager one
    eager.fly()
    other.fly()
    assert_agree(tensors(eager), tensors(other))


def test_the_slot_is_known_in_which_numbers_were_no_longer_finite() -> None:
    """One transition of a learner earned too much; it is not among the first that are sampled."""
    eager, compiled = cohort("ddpg"), cohort("ddpg")
    for trained in (eager, compiled):
        for _ in range(2):
            trained.fly()
        trained.stored["next", "reward"][1, 1] = torch.inf
    compiled.compile()
    finite = [trained.fly().finite.tolist() for trained in (eager, compiled)]
    assert finite[0] == finite[1]
    assert 0 < finite[0][1] < finite[0][0] == finite[0][2] == SCENARIO.num_slots
    for trained in (eager, compiled):
        assert trained.stopped.tolist() == [0, 2 * SCENARIO.num_slots + finite[0][1] + 1, 0]


def test_nothing_is_compiled_before_every_slot_is_followed_by_an_update() -> None:
    waiting = cohort("ddpg", batch_size=12)
    learns = []
    for _ in range(4):
        learns.append(waiting.learns)
        waiting.fly()
    assert learns == [False, False, False, True]  # 0, 5, 10, 15 slots stored


def trained(learners: list[Learner], **changes: Any) -> Training:
    parameters = TrainingParameters(
        num_episodes=8, evaluation_every=2, evaluation_episodes=4, **SMALL
    )
    return Training(
        SCENARIO,
        learners,
        ALGORITHMS["ddpg"](hidden_sizes=(12,)),
        dataclasses.replace(parameters, **changes),
    )


@pytest.mark.parametrize(
    ("cohorts", "learners"),
    [
        pytest.param(  # who share their luck
            *(1, [Learner(scheme, 4) for scheme in MODE_RULES]), marks=pytest.mark.slow
        ),
        (2, [*LEARNERS, *(Learner(scheme, 4) for scheme in MODE_RULES)]),
    ],
)
def test_a_compiled_training_agrees_with_an_eager_one(
    cohorts: int, learners: list[Learner]
) -> None:
    eager, graph = (
        trained(learners, compile=choice, cohorts=cohorts) for choice in ("never", "always")
    )
    for one, two in zip(eager.episodes(), graph.episodes(), strict=True):
        torch.testing.assert_close(
            one.accumulated_reward, two.accumulated_reward, rtol=1e-3, atol=1e-3
        )
    assert all(cohort.is_compiled for cohort in graph.cohorts)
    assert not any(cohort.is_compiled for cohort in eager.cohorts)


def test_disturbing_one_learner_leaves_the_others_bit_for_bit_in_compiled_slots() -> None:
    plain, disturbed = (trained(LEARNERS, compile="always", cohorts=1) for _ in range(2))
    for parameter in disturbed.cohorts[0].algorithm.loss.parameters():
        parameter.data[1].add_(0.1)
    list(plain.episodes())
    list(disturbed.episodes())
    one, other = (dict(t.cohorts[0].algorithm.loss.named_parameters()) for t in (plain, disturbed))
    for name, values in one.items():
        assert torch.equal(values[0], other[name][0])
        assert torch.equal(values[2], other[name][2])
        assert not torch.equal(values[1], other[name][1])


def test_a_restored_compiled_training_continues_bit_for_bit() -> None:
    whole, continued = (trained(LEARNERS, compile="always", cohorts=1) for _ in range(2))
    episodes = whole.episodes()
    for _ in range(5):
        next(episodes)
    assert whole.cohorts[0].is_compiled
    continued.load_state_dict(copy.deepcopy(whole.state_dict()))
    for one, other in zip(episodes, continued.episodes(), strict=True):
        assert torch.equal(one.accumulated_reward, other.accumulated_reward)
    own, expected = tensors(continued.cohorts[0]), tensors(whole.cohorts[0])
    assert all(torch.equal(own[name], expected[name]) for name in expected)


@pytest.mark.slow
def test_mixed_horizons_and_schemes_compiled_on_threads_agree_with_eager_ones() -> None:
    mixed = [Learner("hybrid", 1, 3), Learner("relay", 1), Learner("jamming", 2, 3), Learner()]
    eager, graph = (trained(mixed, compile=choice, cohorts=2) for choice in ("never", "always"))
    for one, two in zip(eager.episodes(), graph.episodes(), strict=True):
        torch.testing.assert_close(
            one.accumulated_reward, two.accumulated_reward, rtol=1e-3, atol=1e-3
        )
    assert all(cohort.is_compiled for cohort in graph.cohorts)


@pytest.fixture
def broken_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """One that is found and does not work, where nothing was compiled before."""
    broken = tmp_path / "g++"
    broken.write_text("#!/bin/sh\necho 'fatal error: Python.h: No such file' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", str(tmp_path / "empty-cache"))
    with torch._inductor.config.patch({"cpp.cxx": (str(broken),)}):
        yield


@pytest.mark.usefixtures("broken_compiler")
def test_where_the_compiler_fails_training_goes_on_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(training_module, "COMPILE_SECONDS", 0.0)
    plain, other = (trained(LEARNERS, compile=choice) for choice in ("never", "auto"))
    expected = list(plain.episodes())
    with pytest.warns(UserWarning, match="training goes on without compiling"):
        episodes = list(other.episodes())
    for one, two in zip(expected, episodes, strict=True):
        assert torch.equal(one.accumulated_reward, two.accumulated_reward)


@pytest.mark.slow
@pytest.mark.usefixtures("broken_compiler")
def test_where_the_compiler_fails_a_training_that_needs_it_is_refused() -> None:
    refusal = r"^compile = 'always': expected a working C\+\+ compiler [^\n]*$"
    with pytest.raises(InputError, match=refusal):
        list(trained(LEARNERS, compile="always").episodes())


def test_compiling_pays_for_long_trainings_only() -> None:
    def pays(episodes: int, learners: int) -> bool:
        chosen = [Learner("hybrid", seed) for seed in range(learners)]
        return trained(chosen, num_episodes=episodes)._compiling_pays()

    assert pays(4_000, learners=1)
    assert not pays(200, learners=3)
    assert pays(1_000, learners=30)


def test_without_a_compiler_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert not trained(LEARNERS, num_episodes=10**9)._compiling_pays()
    assert trained(LEARNERS, compile="always")._compiling_pays()
