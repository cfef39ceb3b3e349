"""The command ``hyuav``, from an empty directory."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import hyuav
from hyuav import cli
from hyuav.experiments.metrics import readable_metrics
from hyuav.experiments.run_directory import RunDirectory
from recipe_calls import TINY, TINY_COMPARISON, Refusal

RECIPES = Path(__file__).parents[1] / "recipes"


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The command as pip installs it, where the shell finds it; the directory is an empty one."""
    file = tmp_path / "bin" / "hyuav"
    file.parent.mkdir()
    program = "import sys\nfrom hyuav.cli import main\nsys.exit(main())\n"
    file.write_text(f"#!{sys.executable}\n{program}")
    file.chmod(0o755)
    monkeypatch.setenv("PATH", f"{file.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(Path(hyuav.__file__).parents[1]))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return "hyuav"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> pytest.MonkeyPatch:
    monkeypatch.chdir(tmp_path)
    return monkeypatch


def call(patch: pytest.MonkeyPatch, *arguments: str) -> None:
    patch.setattr(sys, "argv", ["hyuav", *arguments])
    cli.main()


def refusal(patch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that the command ends with, and status 2."""
    with pytest.raises(SystemExit) as stopped:
        call(patch, *arguments)
    assert stopped.value.code == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("asked", [[], ["-h"], ["--help"]])
def test_the_help_names_every_command_on_one_screen(
    in_process: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], asked: list[str]
) -> None:
    call(in_process, *asked)
    lines = capsys.readouterr().out.splitlines()
    named = [line.split()[0] for line in lines if line.startswith("  ")]
    assert named == [*cli.RECIPES, "benchmark", "copy"]
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80


def test_the_version_is_told(
    in_process: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    call(in_process, "--version")
    assert capsys.readouterr().out == f"hyuav {hyuav.__version__}\n"


def test_an_unknown_command_is_answered_with_the_nearest(
    in_process: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refusal(in_process, capsys, "trian", "seed=0")
    assert line.startswith("error: command = 'trian': expected one of train, evaluate, ")
    assert line.endswith(" (did you mean 'train'?)\n")
    assert line.count("\n") == 1


def test_a_copy_is_the_recipe_and_replaces_no_file(
    in_process: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    call(in_process, "copy", "train")
    assert capsys.readouterr().out == "train.py: edit it, then call it by python train.py\n"
    assert (tmp_path / "train.py").read_bytes() == (RECIPES / "train.py").read_bytes()
    (tmp_path / "train.py").write_text("own")
    line = refusal(in_process, capsys, "copy", "train")
    assert line == "error: train.py is here already, and is kept as it is\n"
    assert (tmp_path / "train.py").read_text() == "own"


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["trian"], "copy = 'trian': expected one of algorithm1, compare, "),
        ([], "copy = '': expected one of algorithm1, compare, "),
        (["../train"], "copy = '../train': expected one of algorithm1, compare, "),
        (["train", "draw"], "copy = ['train', 'draw']: expected one recipe at a time"),
    ],
)
def test_only_one_recipe_is_copied(
    in_process: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    asked: list[str],
    told: str,
) -> None:
    assert told in refusal(in_process, capsys, "copy", *asked)
    assert not list(tmp_path.iterdir())


def test_without_the_repository_the_benchmark_says_how_to_get_it(
    in_process: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    in_process.setattr(cli, "PACKAGE", tmp_path / "python" / "hyuav")
    line = refusal(in_process, capsys, "benchmark")
    assert line.startswith("error: benchmark is not part of the installed package: pip install ")
    assert line.count("\n") == 1


def test_a_mistake_is_told_as_the_recipe_tells_it(command: str, refusal: Refusal) -> None:
    by_command = run(command, "train", "algorithm=ppo")
    assert by_command.returncode == 2
    assert by_command.stderr == refusal("train", "algorithm=ppo")


def test_words_that_are_no_options_are_answered_in_one_line(command: str) -> None:
    line = "error: unrecognized arguments: --foo (NAME=VALUE is written without dashes)\n"
    assert run(command, "train", "--foo").stderr == line
    assert not list(Path.cwd().iterdir())


@pytest.mark.slow
def test_it_trains_evaluates_draws_and_reports(command: str) -> None:
    few = ("evaluation.episodes=4", "evaluation.resolution=10")
    for words in (
        ("train", *TINY, "scenario.num_slots=10", "hydra.run.dir=runs/one"),
        ("evaluate", "run=runs/one", *few),
        ("draw", "run=runs/one", "figures=learning_curves"),
        ("report", "run=runs/one"),
    ):
        done = run(command, *words)
        assert done.returncode == 0, done.stderr
    kept = {path.name for path in Path("runs/one").iterdir()}
    assert {"config.yaml", "evaluation.json", "figures", "report.html"} <= kept


@pytest.mark.slow
def test_a_comparison_works_in_several_processes(command: str) -> None:
    words = ("algorithm=[ddpg,td3]", "scenario=two_clusters", "scheme=relay", *TINY_COMPARISON)
    done = run(command, "compare", *words, "workers=2")
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(f"comparison: {Path.cwd() / 'here'}\n")


@pytest.mark.slow
@pytest.mark.parametrize("by_path", [False, True])
def test_what_it_says_goes_on_with_it(
    command: str, by_path: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    word = command
    if by_path:
        word = str(tmp_path / "bin" / "hyuav")
        monkeypatch.setenv("PATH", os.defpath)
    asked = [*TINY, "training.num_episodes=100000", "training.compile=never", "hydra.run.dir=run"]
    running = subprocess.Popen([word, "train", *asked], stderr=subprocess.PIPE, text=True)
    while not len(readable_metrics("run/metrics.csv")):
        assert running.poll() is None
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    told = running.communicate()[1].splitlines()[-1].partition("; go on with: ")[2]
    assert shlex.split(told) == [word, "train", 'resume="run"']
    before = RunDirectory("run").metrics()["episode"].max()
    running = subprocess.Popen(shlex.split(told), stderr=subprocess.PIPE, text=True)
    while readable_metrics("run/metrics.csv")["episode"].max() <= before:
        assert running.poll() is None
        time.sleep(0.05)
    running.send_signal(signal.SIGTERM)
    running.communicate()
    assert running.returncode == 143
