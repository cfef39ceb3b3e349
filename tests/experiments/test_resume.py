"""A training that is interrupted, or whose files are damaged, and goes on."""

import dataclasses
import errno
import io
import math
import multiprocessing
import os
import re
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from rich.console import Console

from faults import small_disk
from hyuav import InputError
from hyuav._support.errors import Halted
from hyuav.experiments.run_directory import LOCK_FILE, RunConfiguration, RunDirectory
from hyuav.experiments.tracking.checkpoints import first_checkpoint
from hyuav.experiments.train import resume, train, train_or_resume
from hyuav.learning.checkpoint import load_checkpoint, save_checkpoint
from killed_training import OFF, differences, outcome, small

SILENT = Console(file=io.StringIO())
EPISODES = 5  # of an unbroken training; the warm-up takes three


def every_episode(num_episodes: int) -> RunConfiguration:
    """With a checkpoint after each."""
    configuration = small("never", num_episodes)
    training = dataclasses.replace(configuration.training, checkpoint_every=0.0)
    return dataclasses.replace(configuration, training=training)


def interrupt(directory: Path) -> RunDirectory:
    """A training of all episodes, of which 3 are flown."""
    run = train(directory, every_episode(3), OFF, SILENT)
    config = run.config_file.read_text()
    run.config_file.write_text(config.replace("num_episodes: 3", f"num_episodes: {EPISODES}"))
    return run


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return train(
        tmp_path_factory.mktemp("whole") / "run", every_episode(EPISODES), OFF, SILENT
    ).path


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return interrupt(tmp_path_factory.mktemp("part") / "run").path


@pytest.fixture
def run(interrupted: Path, tmp_path: Path) -> RunDirectory:
    shutil.copytree(interrupted, tmp_path / "run")
    return RunDirectory(tmp_path / "run")


def cut(path: Path, share: float) -> None:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


def spoil(path: Path, line: int) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:line], b"\x00what,is,this\n", *lines[line + 1 :]]))


def test_going_on_ends_with_the_numbers_of_an_unbroken_training(
    run: RunDirectory, unbroken: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with run.metrics_file.open("a") as file:  # logged after the last checkpoint, and cut off
        file.write("4,24,0,hybrid,3,6,1.5,,,,0.1,0.2,0.3\n4,24,1,rel")
    resume(run.path, OFF, SILENT)
    assert differences(outcome(run.path), outcome(unbroken)) == []
    assert capsys.readouterr().err == ""


def test_a_training_that_only_began_goes_on_from_its_initial_weights(
    tmp_path: Path, unbroken: Path
) -> None:
    configuration = every_episode(EPISODES)
    start = configuration.new_training()
    run = RunDirectory.create(tmp_path / "run", configuration, None, first_checkpoint(start))
    resume(run.path, OFF, SILENT)
    assert differences(outcome(run.path), outcome(unbroken)) == []


@pytest.mark.parametrize("fault", ["cut", "missing", "metrics cut", "metrics spoilt"])
def test_what_is_damaged_is_told_and_the_checkpoint_before_goes_on_to_the_same_end(
    run: RunDirectory, unbroken: Path, capsys: pytest.CaptureFixture[str], fault: str
) -> None:
    if fault == "cut":
        cut(run.last_checkpoint, 0.7)
    elif fault == "missing":
        run.last_checkpoint.unlink()
    elif fault == "metrics cut":
        cut(run.metrics_file, 0.99)
    else:
        spoil(run.metrics_file, line=9)  # of the third episode
    resume(run.path, OFF, SILENT)
    assert differences(outcome(run.path), outcome(unbroken)) == []
    reason, end = capsys.readouterr().err.splitlines()
    assert (run.metrics_file if "metrics" in fault else run.last_checkpoint).name in reason
    assert end == "going on after episode 2"


def test_rows_that_no_checkpoint_can_bring_back_are_all_that_is_lost(
    run: RunDirectory, unbroken: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil(run.metrics_file, line=2)  # the first episode's second learner
    resume(run.path, OFF, SILENT)
    assert "metrics.csv: its damaged rows are lost" in capsys.readouterr().err
    left, whole = run.metrics(), RunDirectory(unbroken).metrics()
    assert left.drop(columns="seconds").equals(
        whole.drop(index=1).drop(columns="seconds").reset_index(drop=True)
    )


def test_without_a_whole_checkpoint_nothing_is_touched(run: RunDirectory) -> None:
    cut(run.last_checkpoint, 0.5)
    cut(run.previous_checkpoint, 0.9)
    before = run.metrics_file.read_bytes()
    with pytest.raises(InputError, match=r"^last\.pt: checkpoint = .*: expected a checkpoint"):
        resume(run.path, OFF, SILENT)
    assert run.metrics_file.read_bytes() == before


def rewritten(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """A whole checkpoint, with its right checksums, of other content."""
    content = load_checkpoint(path, "training")
    change(content)
    save_checkpoint(path, "training", content)


def put(*path: Any) -> Callable[[dict[str, Any]], object]:
    """Replaces the entry at the path, whose last element is the new value."""
    *before, last, odd = path

    def change(content: dict[str, Any]) -> None:
        for key in before:
            content = content[key]
        content[last] = odd

    return change


ODD: list[tuple[str, Callable[[dict[str, Any]], object]]] = [
    (r"cohorts\[0\].episode", put("training", "cohorts", 0, "episode", math.nan)),
    (r"cohorts\[1\].updates", put("training", "cohorts", 1, "updates", "many")),
    (r"cohorts\[2\].best_weights", put("training", "cohorts", 2, "best_weights", {})),
    (r"cohorts\[1\].episode", put("training", "cohorts", 1, "episode", 7)),
    ("can_compile", put("training", "can_compile", 1)),
    ("training", put("training", torch.zeros(2))),
    ("reported", put("reported", torch.zeros(2))),
    *(
        ("reported.metrics.size", put("reported", "metrics", "size", odd))
        for odd in ("a", -5, 1.5, 10**30)
    ),
    *(("reported.seconds", put("reported", "seconds", odd)) for odd in ("a", None, math.nan, -1.0)),
    ("reported.wandb_id", put("reported", "wandb_id", 3)),
    ("metrics.csv: not what it was", put("reported", "metrics", "size", 2**62)),
]


@pytest.mark.parametrize(("named", "change"), ODD)
def test_a_whole_checkpoint_of_odd_content_is_told_of_and_the_one_before_goes_on(
    run: RunDirectory,
    unbroken: Path,
    capsys: pytest.CaptureFixture[str],
    named: str,
    change: Callable[[dict[str, Any]], object],
) -> None:
    rewritten(run.last_checkpoint, change)
    resume(run.path, OFF, SILENT)
    assert differences(outcome(run.path), outcome(unbroken)) == []
    reason, end = capsys.readouterr().err.splitlines()
    assert re.search(named, reason)
    assert "last.pt" in reason
    assert end == "going on after episode 2"


def test_where_no_checkpoint_fits_nothing_is_overwritten(run: RunDirectory) -> None:
    for file in (run.last_checkpoint, run.previous_checkpoint):
        rewritten(file, put("training", "cohorts", 0, "stopped", None))
    cut(run.best_checkpoint, 0.5)
    for damaged in (False, True):
        if damaged:
            spoil(run.metrics_file, line=2)
        before = {path: path.read_bytes() for path in run.path.rglob("*") if path.is_file()}
        with pytest.raises(InputError) as refused:
            resume(run.path, OFF, SILENT)
        assert "\n" not in str(refused.value)
        after = {path: path.read_bytes() for path in run.path.rglob("*") if path.is_file()}
        assert after == before


def test_where_only_damaged_metrics_and_a_checkpoint_that_does_not_fit_are_left_that_is_told(
    run: RunDirectory, capsys: pytest.CaptureFixture[str]
) -> None:
    rewritten(run.last_checkpoint, put("training", "cohorts", 0, "stopped", None))
    spoil(run.metrics_file, line=2)
    resume(run.path, OFF, SILENT)
    told = capsys.readouterr().err
    assert "last.pt" in told
    assert "metrics.csv: its damaged rows are lost" in told
    assert told.endswith("going on after episode 2\n")


def fifo(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def endless(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut off": lambda path: cut(path, 0.5),
    "missing": lambda path: path.unlink(),
    "a pipe": fifo,
    "a link to a device": endless,
    "of another network": lambda path: save_checkpoint(path, "weights", {"w": torch.zeros(1, 2)}),
}


@pytest.mark.parametrize("how", sorted(DAMAGES))
@pytest.mark.parametrize("finished", [True, False])
def test_damaged_best_weights_are_written_anew(
    interrupted: Path,
    unbroken: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    how: str,
    finished: bool,
) -> None:
    source = unbroken if finished else interrupted
    run = RunDirectory(shutil.copytree(source, tmp_path / "run"))
    DAMAGES[how](run.best_checkpoint)
    resume(run.path, OFF, SILENT)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("best.pt: ")
    assert line.endswith("; written anew from the last checkpoint")
    assert run.best_checkpoint.is_file()
    assert differences(outcome(run.path), outcome(unbroken)) == []


def test_a_pipe_in_the_place_of_the_last_checkpoint_is_not_waited_for(
    run: RunDirectory, unbroken: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fifo(run.last_checkpoint)
    resume(run.path, OFF, SILENT)
    assert differences(outcome(run.path), outcome(unbroken)) == []
    assert "last.pt: checkpoint = " in capsys.readouterr().err


def directory(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        *(("metrics.csv", damage) for damage in (fifo, endless, directory)),
        *((f"checkpoints/{name}.pt", directory) for name in ("best", "last", "previous")),
    ],
)
def test_what_is_in_the_way_is_refused(
    run: RunDirectory, name: str, damage: Callable[[Path], object]
) -> None:
    damage(run.path / name)
    with pytest.raises(InputError, match=rf"^{Path(name).name} = '[^\n]*: expected a file$"):
        resume(run.path, OFF, SILENT)


def test_a_full_disk_halts_a_training_which_goes_on_when_there_is_room(
    unbroken: Path, tmp_path: Path
) -> None:
    with small_disk(tmp_path / "disk") as disk:
        run = interrupt(disk.path / "run")
        line = r"^halted after episode 4 of 5: [^\n]*: (No space|File too large)[^\n]*is kept$"
        with disk.full(), pytest.raises(Halted, match=line) as halted:
            resume(run.path, OFF, SILENT)
        assert halted.value.resumable
        resume(run.path, OFF, SILENT)
        assert differences(outcome(run.path), outcome(unbroken)) == []


def test_a_read_only_directory_is_refused_before_anything_is_done(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        run = interrupt(disk.path / "run")
        with disk.read_only():
            for path in (run.path, disk.path / "another"):
                with pytest.raises(InputError, match=r"run directory = .*: expected a writable"):
                    train_or_resume(path, every_episode(EPISODES), OFF, SILENT)
        assert RunDirectory(run.path).metrics()["episode"].max() == 3


def test_two_processes_do_not_train_in_one_directory(run: RunDirectory) -> None:
    with (
        run.reserved(),
        pytest.raises(InputError, match="expected one in which no other process trains"),
    ):
        resume(run.path, OFF, SILENT)
    assert not (run.path / LOCK_FILE).exists()


def die_reserving(run: RunDirectory) -> None:
    with run.reserved():
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_process_reserves_nothing(run: RunDirectory) -> None:
    other = multiprocessing.get_context("fork").Process(target=die_reserving, args=(run,))
    other.start()
    other.join()
    assert other.exitcode == -signal.SIGKILL
    assert (run.path / LOCK_FILE).exists()
    with run.reserved():
        pass


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK])
def test_where_nothing_can_be_locked_nobody_is_kept_away(
    run: RunDirectory, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", refuse)
    with run.reserved(), run.reserved():
        assert run.exists


def test_the_same_request_goes_on_and_another_is_refused(run: RunDirectory, unbroken: Path) -> None:
    train_or_resume(run.path, every_episode(EPISODES), OFF, SILENT)
    assert differences(outcome(run.path), outcome(unbroken)) == []
    with pytest.raises(InputError, match="expected one without a run in it"):
        train_or_resume(run.path, every_episode(EPISODES + 1), OFF, SILENT)


def test_a_learner_without_finite_numbers_stops_and_the_others_do_not_notice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its critic begins with weights so large that the square of its loss is beyond a float."""
    configuration = every_episode(EPISODES)
    weights = configuration.new_training().best_weights
    healthy = train(tmp_path / "whole", configuration, OFF, SILENT, initial_weights=weights)
    for name, values in weights.items():
        if "value_network" in name:
            values.select(-min(values.ndim, 3), 1).mul_(1e25)
    run = train(tmp_path / "run", configuration, OFF, SILENT, initial_weights=weights)
    (line,) = capsys.readouterr().err.splitlines()
    first = configuration.training.batch_size  # the slot with the first update
    told = f"learner 1 (relay_T8_seed3) stops in episode {1 + (first - 1) // 8}, slot {first}: "
    assert line.startswith(told)
    metrics, whole = run.metrics(), healthy.metrics()
    last = metrics.groupby("learner")["episode"].max().to_dict()
    assert last[0] == last[2] == EPISODES
    assert 8 * last[1] < first <= 8 * last[1] + 8
    for learner in (0, 2):
        own, other = (rows[rows["learner"] == learner] for rows in (metrics, whole))
        assert own["loss_critic"].tolist()[2:] == other["loss_critic"].tolist()[2:]
    assert all(values.isfinite().all() for values in run.best_weights().values())


def test_a_training_halts_when_no_learner_is_left(tmp_path: Path) -> None:
    configuration = every_episode(EPISODES)
    wild = dataclasses.replace(
        configuration.algorithm,
        actor_learning_rate=1.0,
        critic_learning_rate=1.0,
        reward_scale=1e30,
    )
    configuration = dataclasses.replace(configuration, algorithm=wild)
    with pytest.raises(Halted, match=r"^halted after episode \d of \d: every learner has stopped$"):
        train(tmp_path / "run", configuration, OFF, SILENT)
    run = RunDirectory(tmp_path / "run")
    assert all(values.isfinite().all() for values in run.best_weights().values())
    accumulated = run.metrics()["loss_critic"].dropna()
    assert all(math.isfinite(loss) for loss in accumulated)


def test_pytorchs_own_generator_is_not_drawn_from(run: RunDirectory) -> None:
    """Which is why no checkpoint holds its state."""
    configuration = run.configuration()
    training = configuration.new_training()
    before = torch.get_rng_state()
    list(training.episodes())
    assert torch.equal(torch.get_rng_state(), before)
