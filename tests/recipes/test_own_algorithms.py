"""A user's own algorithm, named where it is used: FILE.py:CLASS."""

from pathlib import Path

import pandas as pd
import pytest

from hyuav import InputError, load
from hyuav.experiments.run_directory import RunDirectory
from recipe_calls import TINY, TINY_COMPARISON, Call, Refusal, forget_own

PROGRAM = """
from pydantic.dataclasses import dataclass
from hyuav import DDPG
from hyuav._support.parameters import NonNegativeNumber, parameter

@dataclass(frozen=True)
class Own(DDPG):
    boldness: NonNegativeNumber = parameter(2.0)
"""

SERVED = """
from hyuav import Reward

def _served(slot):
    return slot.offloading.float().mean(dim=-1, keepdim=True)

served = Reward(_served, unit="share of UEs")
"""

SHORT = [*TINY, "training.compile=never", "scenario.num_slots=6"]


@pytest.fixture(autouse=True)
def own(tmp_path: Path) -> str:
    """The file that is named, which no test before has run."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "own.py").write_text(PROGRAM)
    return "mine/own.py:Own"


def test_it_trains_and_is_named_again_to_go_on_and_to_be_evaluated(
    call: Call, refusal: Refusal, tmp_path: Path, own: str
) -> None:
    call("train", f"algorithm={own}", "algorithm.boldness=3", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    assert run.name.endswith("_two_clusters_own_Own_0")
    configuration = RunDirectory(run).configuration()
    assert configuration.algorithm_name == "own.py:Own"
    assert configuration.algorithm.to_dict()["boldness"] == 3.0
    forget_own()
    (tmp_path / "own.py").write_text("raise SystemExit('it was run')\n")
    path, few = str(run.relative_to(tmp_path)), ["evaluation.episodes=4"]
    few += ["evaluation.resolution=10"]
    asked = "expected an algorithm of a file that you name: algorithm=DIRECTORY/own.py:Own"
    for recipe, name in (("train", "resume"), ("evaluate", "run"), ("draw", "run")):
        assert refusal(recipe, f"{name}={path}") == f"error: algorithm = 'own.py:Own': {asked}\n"
    call("train", f"resume={path}", f"algorithm={own}")
    call("evaluate", f"run={path}", f"algorithm={own}", *few)
    assert (run / "evaluation.json").exists()
    forget_own()
    with pytest.raises(InputError, match=asked):
        load(run)
    policy = load(run, algorithm=str(tmp_path / own)).policy
    assert policy.make_env(batch_size=3).rollout(6, policy)["action"].shape == (3, 6, 2)


def test_jobs_of_a_multirun_may_name_it(call: Call, tmp_path: Path, own: str) -> None:
    call("train", "-m", f"algorithm=ddpg,{own}", *SHORT)
    names = sorted(path.parent.name for path in (tmp_path / "runs").glob("*/*/config.yaml"))
    assert names == ["0_two_clusters_ddpg_0", "1_two_clusters_own_Own_0"]


def test_workers_of_a_comparison_run_it_and_a_reward_of_ones_own(
    call: Call, tmp_path: Path, own: str
) -> None:
    (tmp_path / "mine" / "rewards.py").write_text(SERVED)
    few = [each for each in TINY_COMPARISON if not each.startswith("workers=")]
    asked = ["scenario=two_clusters", "scheme=hybrid", *few, "workers=2"]
    call("compare", f"algorithm=[{own}]", "reward=mine/rewards.py:served", *asked)
    results = pd.read_parquet(tmp_path / "here" / "results.parquet")
    assert set(results["algorithm"]) == {"own.py:Own"}
    assert (tmp_path / "here" / "shards" / "own_Own_two_clusters_T8").exists()
    assert (results["earned"] <= 8.0).all()
    assert (results["fraction"] == results["earned"] / results["optimum"]).all()


@pytest.mark.parametrize(
    ("recipe", "argument", "line"),
    [
        ("train", "algorithm=gone.py:Own", "algorithm = 'gone.py': expected a Python file"),
        ("train", "algorithm=mine/own.py", "algorithm = 'mine/own.py': expected a class in it"),
        ("compare", "algorithm=[ddpg,gone.py:Own]", "algorithm = 'gone.py': expected a Python"),
        ("compare", "algorithm=[ddpg,own]", "algorithm[1] = 'own': expected one of ddpg,"),
        ("evaluate", "algorithm=ddpg", "algorithm = 'ddpg': expected FILE.py:CLASS"),
    ],
)
def test_what_is_none_is_told_in_one_line(
    refusal: Refusal, recipe: str, argument: str, line: str
) -> None:
    assert refusal(recipe, argument).startswith(f"error: {line}")
