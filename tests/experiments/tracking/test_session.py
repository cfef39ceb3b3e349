import io
import json
import os
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import wandb
from rich.console import Console

from hyuav.experiments.tracking import LoggerParameters, Session
from hyuav.experiments.tracking.session import remembered
from offline_wandb import history, offline_runs, recorded

KEY = "0123456789abcdef0123456789abcdef01234567"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user's home, in which the user works, with a key."""
    home = tmp_path / "homes" / "somebodys-home"
    (home / "work").mkdir(parents=True)
    for name in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(name, str(home))
    for name in ("USER", "LOGNAME", "USERNAME"):
        monkeypatch.setenv(name, "somebody-known")
    monkeypatch.setenv("WANDB_API_KEY", KEY)
    monkeypatch.setattr(socket, "gethostname", lambda: "a-machine-at-home")
    monkeypatch.delenv("WANDB_DATA_DIR", raising=False)
    monkeypatch.delenv("WANDB_CACHE_DIR", raising=False)
    monkeypatch.setenv("WANDB_BASE_URL", "http://127.0.0.1:9")  # where nobody listens
    monkeypatch.chdir(home / "work")
    wandb.teardown()  # so that it reads the environment again
    yield home
    wandb.teardown()


def open_session(
    directory: Path, logger: LoggerParameters | None = None, console: Console | None = None
) -> Session:
    directory.mkdir(parents=True, exist_ok=True)
    return Session(
        directory,
        logger or LoggerParameters(),
        {"algorithm": {"discount": 0.9}},
        "train",
        console=console or Console(file=io.StringIO()),
        memory=directory,
    )


def test_a_run_is_found_under_what_its_users_call_it(tmp_path: Path) -> None:
    logger = LoggerParameters(
        project="offloading", entity="lab", group="paper", name="first", tags=("a", "b"), id="own"
    )
    with open_session(tmp_path, logger):
        pass
    (file,) = offline_runs(tmp_path)
    (run,) = recorded(file, "run")
    assert (run.project, run.entity, run.run_group) == ("offloading", "lab", "paper")
    assert (run.display_name, run.run_id, run.job_type) == ("first", "own", "train")
    assert list(run.tags) == ["a", "b"]
    (config,) = [each for each in run.config.update if each.key == "algorithm"]
    assert json.loads(config.value_json) == {"discount": 0.9}
    assert recorded(file, "exit")[0].exit_code == 0


def test_a_directory_is_one_run_however_often_it_is_opened(tmp_path: Path) -> None:
    for number in (1, 2):
        with open_session(tmp_path) as session:
            session.log({"number": number}, number)
    files = offline_runs(tmp_path)
    assert [history(file)[0]["number"] for file in files] == [1, 2]
    assert len({recorded(file, "run")[0].run_id for file in files}) == 1


def test_a_failure_is_recorded_as_one_and_passed_on(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), open_session(tmp_path):
        raise ZeroDivisionError
    (file,) = offline_runs(tmp_path)
    assert recorded(file, "exit")[0].exit_code == 1


def test_the_end_says_in_one_line_how_to_sync_and_to_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shown = io.StringIO()
    with open_session(tmp_path / "runs" / "a", console=Console(file=shown, width=40)):
        pass
    path = "runs/a/wandb"
    expected = f"W&B, offline: wandb sync {path} (in the terminal: wandb leet {path})\n"
    assert shown.getvalue() == expected


def test_without_a_server_the_run_is_an_offline_one(
    home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hyuav.experiments.tracking.session.SECONDS_TO_BEGIN", 2.0)
    with open_session(home / "work" / "run", LoggerParameters(mode="online")) as session:
        session.log({"a": 1})
    (file,) = offline_runs(home / "work" / "run")
    assert history(file)[0]["a"] == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("W&B: not online (")
    assert line.endswith("); going on offline")
    assert told_of(home) == []


def test_what_fails_is_told_once_and_nothing_more_is_logged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_session(tmp_path) as session:
        session.log({"a": 1})
        session.attempt(lambda run: run.log({"b": wandb.Image("no such file.png")}))
        session.log({"a": 2})
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("W&B: nothing more is logged (")
    (file,) = offline_runs(tmp_path)
    assert [row["a"] for row in history(file)] == [1]


def test_nothing_of_the_user_or_the_machine_is_written_down(home: Path) -> None:
    directory = home / "work" / "runs" / "mine"
    checkpoint = directory / "best.pt"
    with open_session(directory) as session:
        checkpoint.write_bytes(b"weights")
        session.log({"number": 1.0})
        session.attempt(lambda run: run.log({"table": wandb.Table(columns=["a"], data=[[1]])}))
        session.attempt(lambda run: run.log({"report": wandb.Html("<p>report</p>", inject=False)}))
        session.log_model({"best": checkpoint}, {"episodes": 1})
    (file,) = offline_runs(directory)
    artifacts = recorded(file, "artifact")
    assert [artifact.type for artifact in artifacts] == ["run_table", "model"]
    for artifact in artifacts:
        (entry,) = artifact.manifest.contents
        assert Path(entry.local_path).is_file()
    (run,) = recorded(file, "run")
    assert run.host == "not-recorded"
    kept = {path.name for path in directory.rglob("*")}
    assert "debug.log" in kept  # looked through below
    assert "wandb-metadata.json" not in kept
    assert told_of(home) == []


def told_of(home: Path) -> list[tuple[str, str]]:
    """Where files and links below the directory of work name the user, the machine or Python's."""
    secrets = (KEY, home.name, "somebody-known", "a-machine-at-home", sys.prefix)
    found = []
    for path in (home / "work").rglob("*"):
        if path.is_symlink():
            content = str(path.readlink()).encode()
        elif path.is_file():
            content = path.read_bytes()
        else:
            continue
        found += [(path.name, secret) for secret in secrets if secret.encode() in content]
    return found


@pytest.mark.parametrize("content", ["", "[]", "{", '{"id": 3}', "\x00", "[" * 10**5, "pipe"])
def test_a_foreign_memory_is_told_of_and_the_run_is_a_new_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    file = tmp_path / "wandb.json"
    os.mkfifo(file) if content == "pipe" else file.write_text(content)
    with open_session(tmp_path, LoggerParameters(mode="disabled")) as session:
        assert session.id is None
    assert capsys.readouterr().err == ""
    with open_session(tmp_path) as session:
        session.log({"a": 1})
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"W&B: {file} is damaged: the run that it was for is not known, and cannot be continued"
    )
    assert remembered(tmp_path)["id"] == session.id
    assert len(offline_runs(tmp_path)) == 1
