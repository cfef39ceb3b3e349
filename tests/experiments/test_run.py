import dataclasses
import shutil
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
import pytest
import torch

from hyuav import EvaluationParameters, InputError, Policy, Run, evaluate, load
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.train import train
from hyuav.learning.guide.robust import RobustDDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.physics.scenario import Scenario
from sample_runs import SILENT, UNLOGGED

EPISODES = 60

LEARNERS = (Learner("hybrid", 3), Learner("relay", 3), Learner("relay", 4), Learner("hybrid", 3, 5))
HORIZONS = (6, 6, 6, 5)


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A training of the robust variant, whose policies need the clock and the geofence."""
    configuration = RunConfiguration(
        "two_clusters",
        dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6),
        LEARNERS,
        "ddpg_robust",
        RobustDDPG(hidden_sizes=(8,), guide=None),
        TrainingParameters(num_episodes=2, batch_size=8, evaluation_every=1, compile="never"),
    )
    path = tmp_path_factory.mktemp("runs") / "robust"
    return train(path, configuration, UNLOGGED, SILENT).path


@pytest.fixture(scope="module")
def run(directory: Path) -> Run:
    return load(directory)


@pytest.fixture
def earning(directory: Path, tmp_path: Path) -> Any:
    """The same run, had its learners earned something else."""

    def change(*earned: float) -> Run:
        own = shutil.copytree(directory, tmp_path / "run")
        metrics = pd.read_csv(own / "metrics.csv")
        metrics["best_evaluation"] = metrics["learner"].map(dict(enumerate(earned)))
        metrics.to_csv(own / "metrics.csv", index=False)
        return load(own)

    return change


def test_a_run_tells_what_was_asked_and_what_came_of_it(run: Run, directory: Path) -> None:
    assert run.configuration == RunDirectory(directory).configuration()
    assert run.scenario == run.configuration.scenario
    assert [(own.scheme, own.seed, own.num_slots) for own in run.learners] == [
        (own.scheme, own.seed, horizon) for own, horizon in zip(LEARNERS, HORIZONS, strict=True)
    ]
    assert sorted(run.metrics["learner"].unique()) == [0, 1, 2, 3]


def test_each_policy_brings_the_environment_of_its_learner(run: Run) -> None:
    assert len(run.policies) == len(run.learners)
    for policy, learner, horizon in zip(run.policies, run.learners, HORIZONS, strict=True):
        assert policy.environment == {
            "scenario": dataclasses.replace(run.scenario, num_slots=horizon),
            "scheme": learner.scheme,
            "clock": True,
            "geofence": True,
        }
        flown = policy.make_env(batch_size=(3,), seed=0).rollout(20, policy)
        assert flown.shape == (3, horizon)
        assert not flown["next", "off_map"].any()


def test_a_policy_earns_what_its_learner_earned(run: Run) -> None:
    best = run.metrics.groupby("learner")["best_evaluation"].max()
    for index, policy in enumerate(run.policies):
        flown = policy.make_env(batch_size=(3000,), seed=5).rollout(20, policy)
        earned = flown["next", "episode_reward"][:, -1].mean().item()
        assert earned == pytest.approx(best[index], rel=0.1, abs=0.3)


@pytest.mark.parametrize(
    ("earned", "asked", "learner"),
    [
        ((1.0, 4.0, 2.0, 3.0), {}, 1),
        ((1.0, 4.0, 2.0, 3.0), {"scheme": "hybrid"}, 3),
        ((1.0, 4.0, 2.0, 3.0), {"scheme": "hybrid", "num_slots": 6}, 0),
        ((1.0, 4.0, 2.0, 3.0), {"seed": 4}, 2),
        ((1.0, 4.0, 2.0, 3.0), {"scheme": "relay", "seed": np.int64(3)}, 1),
        ((np.nan, np.nan, -2.0, np.nan), {}, 2),
        ((np.nan,) * 4, {"scheme": "relay"}, 1),
    ],
)
def test_the_best_policy_is_of_the_learner_that_earned_most(
    earning: Any, earned: tuple[float, ...], asked: dict[str, Any], learner: int
) -> None:
    changed = earning(*earned)
    assert changed.best_policy(**asked) is changed.policies[learner]
    if not asked:
        assert changed.policy is changed.policies[learner]
        assert changed.make_env().base_env.schemes == (changed.learners[learner].scheme,)


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"scheme": "jamming"}, "scheme = 'jamming': expected that of a learner: hybrid, relay"),
        ({"seed": 7}, "seed = 7: expected that of a learner: 3, 4"),
        ({"scheme": "relay", "num_slots": 5}, "num_slots = 5: expected that of a learner: 6"),
    ],
)
def test_a_learner_that_is_not_there_is_refused(run: Run, asked: Any, line: str) -> None:
    with pytest.raises(InputError) as refused:
        run.best_policy(**asked)
    assert str(refused.value) == line


def test_what_is_missing_is_told_where_it_is_needed(directory: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^run = '.*': expected a run directory"):
        load(tmp_path)
    own = shutil.copytree(directory, tmp_path / "run")
    (own / "metrics.csv").unlink()
    assert load(own).best_policy(num_slots=5).environment["scenario"].num_slots == 5
    with pytest.raises(InputError, match=r"^metrics = "):
        load(own).make_env()
    (own / "checkpoints" / "best.pt").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"^checkpoint = "):
        _ = load(own).policies


def test_the_policies_of_a_run_are_evaluated_as_they_are(run: Run) -> None:
    policies = {"proposed": run.policies[0], "re_ot": run.policies[1:3]}
    summary = evaluate(run.scenario, "two_clusters", policies, EvaluationParameters(episodes=9))
    learners = {name: own["learners"] for name, own in summary.summary["schemes"].items()}
    assert learners == {"proposed": 1, "re_ot": 2}


@pytest.mark.parametrize("trained", [True, False])
def test_stable_baselines3_evaluates_a_policy_through_gymnasium(trained: bool, run: Run) -> None:
    evaluation = pytest.importorskip("stable_baselines3.common.evaluation")
    untrained = Policy(torch.nn.Sequential(torch.nn.Linear(15, 2), torch.nn.Tanh()), run.scenario)
    policy = run.policy if trained else untrained
    env = gymnasium.make("hyuav/SecureOffloading-v0", **policy.environment)
    env.reset(seed=4)
    mean, deviation = evaluation.evaluate_policy(policy, env, n_eval_episodes=EPISODES, warn=False)
    with torch.no_grad():
        flown = policy.make_env(batch_size=(3000,), seed=4).rollout(20, policy)
    earned = flown["next", "episode_reward"][:, -1]
    assert mean == pytest.approx(earned.mean().item(), abs=4 * deviation / EPISODES**0.5 + 1e-3)


def test_stable_baselines3_takes_the_policy_of_a_batch(run: Run) -> None:
    policy = run.best_policy(num_slots=6)
    envs = gymnasium.make_vec("hyuav/SecureOffloading-v0", num_envs=4, **policy.environment)
    observations, _ = envs.reset(seed=0)
    for _ in range(7):
        actions, _ = policy.predict(observations)
        observations, _, _, _, info = envs.step(actions)
        assert not info["off_map"].any()


def test_a_gymnasium_environment_without_the_clock_is_refused(run: Run) -> None:
    env = gymnasium.make("hyuav/SecureOffloading-v0", scenario="two_clusters")
    with pytest.raises(InputError, match=r"observation = \(15,\): expected .* clock=True"):
        run.policy.predict(env.reset(seed=0)[0])


def test_an_actor_of_stable_baselines3_becomes_a_policy(tmp_path: Path) -> None:
    td3 = pytest.importorskip("stable_baselines3").TD3
    options: dict[str, Any] = {"scenario": "two_clusters", "clock": True, "geofence": True}
    model = td3("MlpPolicy", gymnasium.make("hyuav/SecureOffloading-v0", **options), device="cpu")
    policy = Policy(model.policy.actor, **options)
    env = policy.make_env(batch_size=(2, 3), seed=0)
    with torch.no_grad():
        flown = env.rollout(3, policy)
    expected, _ = model.predict(flown["observation"].flatten(0, 2).numpy(), deterministic=True)
    np.testing.assert_allclose(policy.act(flown["observation"]).flatten(0, 2), expected, atol=1e-6)
    policy.export(tmp_path / "policy.pt2")
    observed = torch.rand(5, 16)
    loaded = torch.export.load(tmp_path / "policy.pt2").module()
    torch.testing.assert_close(loaded(observed), policy.act(observed))
