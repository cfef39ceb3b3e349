"""A reward of one's own, named where it is used, or one that comes with the package."""

import json
from pathlib import Path
from typing import Any

import pytest

from hyuav.experiments.run_directory import RunDirectory
from recipe_calls import TINY, Call, Refusal, forget_own

PROGRAM = """
from hyuav import Reward

def _served(slot):
    return slot.offloading.float().mean(dim=-1, keepdim=True)

served = Reward(_served, unit="share of UEs")

def unstable(slot):
    return slot.sum_rate.log() * float("nan")

nothing = 3
"""

SHORT = [*TINY, "training.compile=never", "scenario.num_slots=6"]
FEW = ["evaluation.episodes=4", "evaluation.resolution=20"]


@pytest.fixture(autouse=True)
def own(tmp_path: Path) -> str:
    """The file that is named, which no test before has run."""
    (tmp_path / "my").mkdir()
    (tmp_path / "my" / "mine.py").write_text(PROGRAM)
    return "my/mine.py:served"


def summary(directory: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((directory / "evaluation.json").read_text())
    return content


def test_it_trains_and_is_named_again_to_go_on_and_to_be_evaluated(
    call: Call,
    refusal: Refusal,
    tmp_path: Path,
    own: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    call("train", f"reward={own}", *SHORT)
    assert "accumulated reward (share of UEs): " in capsys.readouterr().out
    (run,) = (tmp_path / "runs").iterdir()
    assert RunDirectory(run).configuration().reward.unit == "share of UEs"
    forget_own()
    path = str(run.relative_to(tmp_path))
    asked = "expected a reward of a file that you name: reward=DIRECTORY/mine.py:served"
    for recipe, name in (("train", "resume"), ("evaluate", "run"), ("draw", "run")):
        assert refusal(recipe, f"{name}={path}") == f"error: reward = 'mine.py:served': {asked}\n"
    call("train", f"resume={path}", f"reward={own}")
    capsys.readouterr()
    call("evaluate", f"run={path}", f"reward={own}", *FEW)
    told = capsys.readouterr().out
    assert "Served (share of" in told  # the table's title goes on in a second line
    assert "UEs)" in told
    assert "(share of UEs)" in (run / "report.html").read_text()
    found = summary(run)
    assert found["reward"] == {"name": "mine.py:served", "unit": "share of UEs"}
    best = found["schemes"]["optimum"]
    assert best["fraction_of_optimum"] == 1.0
    assert 0.0 < best["reward"]["mean"] <= 6.0
    assert best["secrecy_sum_rate"]["mean"] > 0.0
    call("draw", f"run={path}", f"reward={own}", "figures=[learning_curves]")


def test_a_run_may_be_evaluated_by_another_reward(call: Call, tmp_path: Path) -> None:
    call("train", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    path = str(run.relative_to(tmp_path))
    call("evaluate", f"run={path}", "output=other", "reward=secrecy_energy_efficiency", *FEW)
    assert summary(tmp_path / "other")["reward"]["unit"] == "bit/Hz/J"
    call("evaluate", f"run={path}", *FEW)
    assert "reward" not in summary(run)


def test_without_an_optimum_one_sentence_says_so(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call("train", "reward=proportional_fairness", *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    call("evaluate", f"run={run.relative_to(tmp_path)}", *FEW)
    assert "no optimum: a transform need not add up over slots" in capsys.readouterr().out
    schemes = summary(run)["schemes"]
    assert set(schemes) == {"proposed", "re_lt", "ja_lt", "no_helper"} & set(schemes)
    assert "fraction_of_optimum" not in schemes["proposed"]
    assert "bps/Hz" not in (run / "report.html").read_text().partition("Learning curves")[2][:400]


@pytest.mark.parametrize(
    ("recipe", "argument", "line"),
    [
        ("train", "reward=gone.py:served", "reward = 'gone.py': expected a Python file"),
        ("train", "reward=my/mine.py", "reward = 'my/mine.py': expected a name in it"),
        ("train", "reward=my/mine.py:gone", "reward = 'my/mine.py:gone': expected a function"),
        ("train", "reward=my/mine.py:nothing", "reward = 'my/mine.py:nothing': expected a func"),
        ("train", "reward=my/mine.py:unstable", "reward = 'mine.py:unstable': expected a function"),
        ("train", "reward=sumrate", "reward = 'sumrate': expected one of sum_rate,"),
        ("compare", "reward=proportional_fairness", "reward = 'proportional_fairness': expected"),
        ("evaluate", "reward=fairness", "run is missing"),
        ("draw", "reward=sum_rate", "reward = 'sum_rate': expected FILE.py:NAME"),
    ],
)
def test_what_is_none_is_told_in_one_line(
    refusal: Refusal, recipe: str, argument: str, line: str
) -> None:
    assert refusal(recipe, argument).startswith(f"error: {line}")
