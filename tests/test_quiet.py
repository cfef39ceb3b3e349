"""No word of a library reaches whoever uses this one, and theirs are left as they set them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from recipe_calls import TINY_TRAINING

FLY = """
import gymnasium
import hyuav
from hyuav import Scenario, SecureOffloadingEnv, make_env

make_env("two_clusters", scheme="hybrid", batch_size=4, seed=0).rollout(3)
SecureOffloadingEnv(Scenario.preset("random_disk")).rollout(3)
env = gymnasium.make("hyuav/SecureOffloading-v0", scenario="two_clusters")
env.reset(seed=0)
env.step(env.action_space.sample())
env.close()
envs = gymnasium.make_vec("hyuav/SecureOffloading-v0", num_envs=3, scenario="two_clusters")
envs.reset(seed=0)
envs.step(envs.action_space.sample())
envs.close()
"""

LEARN = """
import dataclasses
import hyuav

scenario = dataclasses.replace(hyuav.Scenario.preset("two_clusters"), num_slots=5)
short = hyuav.TrainingParameters(
    num_episodes=2, batch_size=8, evaluation_episodes=3, compile="never"
)
guide = hyuav.Guide(warm_up_episodes=1)
for algorithm in (
    hyuav.DDPG(hidden_sizes=(8,)),
    hyuav.TD3(hidden_sizes=(8,)),
    hyuav.SAC(hidden_sizes=(8,)),
    hyuav.RobustDDPG(hidden_sizes=(8,), guide=guide),
):
    learners = [hyuav.Learner("hybrid"), hyuav.Learner("relay")]
    training = hyuav.Training(scenario, learners, algorithm, short)
    assert len(list(training.episodes())) == 2
"""

JUDGE = """
import dataclasses
import hyuav

scenario = dataclasses.replace(hyuav.Scenario.preset("two_clusters"), num_slots=5)
best = hyuav.solve_optimum(scenario, resolution=10.0)["hybrid"].policy
few = hyuav.EvaluationParameters(episodes=3, flights=2)
hyuav.evaluate(scenario, "own", {"optimum": [best]}, few)
"""

COMPILED = """
import dataclasses
import hyuav

scenario = dataclasses.replace(hyuav.Scenario.preset("two_clusters"), num_slots=5)
hyuav.make_env(scenario, batch_size=4, seed=0, compiled=True).rollout(5)
parameters = hyuav.TrainingParameters(
    num_episodes=3, batch_size=8, evaluation_episodes=3, compile="always"
)
training = hyuav.Training(
    scenario, [hyuav.Learner("hybrid")], hyuav.DDPG(hidden_sizes=(8,)), parameters
)
assert len(list(training.episodes())) == 3
"""

SETTINGS = """
import gc, logging, signal, sys, warnings
import gymnasium, matplotlib.pyplot, pandas, scipy.sparse, scipy.special  # have filters
import torch, tensordict, torchrl.envs

def settings():
    manager = logging.root.manager.loggerDict
    loggers = [logging.root, *(each for each in manager.values() if hasattr(each, "handlers"))]
    known = {each.name: (each.level, each.propagate, list(each.handlers)) for each in loggers}
    own = {name: known[name] for name in ("root", "torchrl", "tensordict")}
    return own, signal.getsignal(signal.SIGINT), sys.excepthook, gc.get_threshold()

before, filters = settings(), list(warnings.filters)
"""


def run(directory: Path, *arguments: str, **environment: str) -> tuple[str, str]:
    """What a fresh Python prints, in which every warning is an error."""
    ended = subprocess.run(
        [sys.executable, "-W", "error", *arguments],
        cwd=directory,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout, ended.stderr


def test_a_program_prints_what_it_says_itself(tmp_path: Path) -> None:
    assert run(tmp_path, "-c", f"{FLY}{LEARN}{JUDGE}") == ("", "")


@pytest.mark.slow
def test_a_compiler_at_work_is_not_heard(tmp_path: Path) -> None:
    cold = str(tmp_path / "cache")
    assert run(tmp_path, "-c", COMPILED, TORCHINDUCTOR_CACHE_DIR=cold) == ("", "")


@pytest.mark.parametrize("logger", ["wandb", "tensorboard"])
def test_commands_print_their_own_lines_alone(tmp_path: Path, logger: str) -> None:
    command = "from hyuav.cli import main; main()"
    tiny = (*TINY_TRAINING, "algorithm.hidden_sizes=[8]", "scenario.num_slots=5")
    out, err = run(tmp_path, "-c", command, "train", "-m", "seed=0,1", f"logger={logger}", *tiny)
    assert err == ""
    assert {line.partition(":")[0] for line in out.splitlines()} == {
        {"wandb": "W&B, offline", "tensorboard": "TensorBoard"}[logger],
        *("best noise-free accumulated reward (bps/Hz)", "run", "its report"),
    }


def test_filters_of_warnings_and_loggers_stay_as_they_were(tmp_path: Path) -> None:
    ask = "hyuav.compare\nassert settings() == before\nassert warnings.filters == filters"
    assert run(tmp_path, "-c", f"{SETTINGS}{LEARN}{JUDGE}{ask}") == ("", "")
