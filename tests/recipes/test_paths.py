"""Paths on the command line: odd names, files of one's own, another working directory."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from hyuav import Scenario
from hyuav._support import program
from hyuav.experiments import train as trainings
from hyuav.experiments.quoting import in_quotes
from hyuav.experiments.run_directory import RunDirectory
from recipe_calls import FEW, TINY, Call, Refusal

OWN = """
from pydantic.dataclasses import dataclass
from hyuav import DDPG

@dataclass(frozen=True)
class Own(DDPG):
    pass
"""
RECIPES = Path(__file__).parents[2] / "recipes"
SHORT = (*TINY, "training.compile=never", "num_slots=6")
ODD = """Läufe, [lr=0.1] $HOME ${x} 'a' "b" \\"""


def interrupted(
    call: Call,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    recipe: str,
    *arguments: str,
) -> str:
    """A recipe that is interrupted when it begins to train: the command to go on that it tells."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(program, "called", [sys.executable, str(RECIPES / f"{recipe}.py")])
    with monkeypatch.context() as patched:
        patched.setattr(trainings, "_train", interrupt)
        with pytest.raises(SystemExit) as stopped:
            call(recipe, *arguments)
    assert stopped.value.code == 130
    told, _, command = capsys.readouterr().err.partition("; go on with: ")
    assert told == "interrupted"
    return command


def test_the_command_to_go_on_works_in_a_shell_whatever_the_directory_is_called(
    call: Call, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    directory = f"hydra.run.dir={in_quotes(ODD)}"
    command = interrupted(call, monkeypatch, capsys, "train", directory, *SHORT)
    assert RunDirectory(tmp_path / ODD).exists
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert RunDirectory(tmp_path / ODD).metrics()["episode"].max() == 4


def test_the_same_call_is_told_with_the_files_that_it_named(
    call: Call, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "own" / "scenario").mkdir(parents=True)
    for file in (tmp_path / "my area.yaml", tmp_path / "own" / "scenario" / "area.yaml"):
        Scenario.preset("two_clusters").save(file)
    own = ["scenario=my area.yaml"], ["--config-dir", "own", "scenario=area"]
    for number, files in enumerate(own):
        asked, place = [*files, *SHORT[:-1], "candidates=1"], f"hydra.run.dir=jobs/{number}"
        command = interrupted(call, monkeypatch, capsys, "reproduce", *asked, place)
        assert shlex.split(command)[2:] == [*asked, place]


def test_a_yaml_file_is_chosen_by_its_path_and_changed_field_by_field(
    call: Call, tmp_path: Path
) -> None:
    OmegaConf.save({"ue_positions": [[1, 2], [3, 4]]}, tmp_path / "2 UEs.yaml")
    algorithm = {"name": "ddpg_robust", "guide": {"warm_up_episodes": 1}}
    (tmp_path / "own").mkdir()
    OmegaConf.save(algorithm, tmp_path / "own" / "quick.yml")
    fields = ["scenario.ue_power=0.2", "algorithm.guide.repeat_every=8"]
    call("train", "scenario=2 UEs.yaml", "algorithm=own/quick.yml", *fields, *SHORT)
    (run,) = (tmp_path / "runs").iterdir()
    assert run.name.endswith("__2_UEs_quick_0")
    configuration = RunDirectory(run).configuration()
    assert configuration.scenario.ue_positions == ((1.0, 2.0), (3.0, 4.0))
    assert configuration.scenario.ue_power == 0.2
    assert configuration.algorithm_name == "ddpg_robust"
    guide = configuration.algorithm.to_dict()["guide"]
    assert (guide["warm_up_episodes"], guide["repeat_every"]) == (1, 8)


FILES = [
    ("scenario=none.yaml", "configuration file 'none.yaml': cannot be read ("),
    ("scenario=a/x.yaml,b/x.yaml", "scenario = 'a/x.yaml,b/x.yaml': expected files of different"),
    ("algorithm=plain.yaml", "algorithm = 'plain': expected one of ddpg, td3"),
    ("scenario=orders.yaml", "configuration file = 'orders.yaml': expected no 'hydra' in it"),
    ("scenario=odd.yaml", "scenario: unknown field 'ue_powr': did you mean 'ue_power'?"),
]


def test_a_yaml_file_that_cannot_be_chosen_is_told_in_one_line(
    refusal: Refusal, tmp_path: Path
) -> None:
    for name, content in {
        **dict.fromkeys(("a/x.yaml", "b/x.yaml"), "ue_positions: [[1, 2]]\n"),
        "plain.yaml": "hidden_sizes: [8]\n",
        "orders.yaml": "hydra: {run: {dir: elsewhere}}\n",
        "odd.yaml": "ue_positions: [[1, 2]]\nue_powr: 3\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    for argument, line in FILES:
        assert refusal("train", argument).startswith(f"error: {line}")


def test_paths_are_told_from_where_the_command_was_called_whatever_hydra_does(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = "hydra.job.chdir=True"
    call("train", there, "hydra.run.dir=first", *SHORT)
    call("train", there, "warm_start=first", "hydra.run.dir=second", *SHORT)
    call("train", there, "resume=second", "training.num_episodes=5")
    call("evaluate", there, "run=[first,second]", "output=both", *FEW)
    capsys.readouterr()
    call("draw", there, "run=second", "figures=learning_curves")
    assert capsys.readouterr().out == "figures: second/figures\n"
    assert {path.name for path in tmp_path.iterdir() if path.is_dir()} >= {
        "first",
        "second",
        "both",
    }
    assert RunDirectory(tmp_path / "second").metrics()["episode"].max() == 5
    assert (tmp_path / "second" / "figures" / "learning_curves.pdf").exists()
    assert not any((tmp_path / "runs").iterdir())


def test_an_algorithms_file_may_lie_in_an_odd_place(call: Call, tmp_path: Path) -> None:
    (tmp_path / "eigene é").mkdir()
    file = "eigene é/own_path.py"
    (tmp_path / file).write_text(OWN)
    for reference, run in ((f"{file}:Own", "a"), (f'"{file}:Own"', "b")):
        asked = [f"algorithm={reference}", f"hydra.run.dir={run}", "hydra.job.chdir=True"]
        call("train", *asked, *SHORT)
        configuration = RunDirectory(tmp_path / run).configuration()
        assert configuration.algorithm_name == "own_path.py:Own"
