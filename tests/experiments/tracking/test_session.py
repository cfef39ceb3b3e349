import io
import json
import os
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import wandb
from rich.console import Console

from hyuav.experiments.tracking import Job, LoggerParameters, Session
from hyuav.experiments.tracking.logged_run import LoggedRun
from hyuav.experiments.tracking.memory import remembered
from hyuav.experiments.tracking.wandb_run import WandbRun
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
    job = Job(directory, {"algorithm": {"discount": 0.9}}, "train", memory=directory)
    return Session(job, logger or LoggerParameters(), console or Console(file=io.StringIO()))


def log(session: Session, step: int = 0, **values: float) -> None:
    session.attempt(lambda run: run.scalars(values, step))


def log_media(session: Session, name: str, make: Callable[[], object]) -> None:
    def action(run: LoggedRun) -> None:
        assert isinstance(run, WandbRun)
        run.run.log({name: make()})

    session.attempt(action)


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
            log(session, number, number=number)
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
    monkeypatch.setattr("hyuav.experiments.tracking.wandb_run.SECONDS_TO_BEGIN", 2.0)
    with open_session(home / "work" / "run", LoggerParameters(mode="online")) as session:
        log(session, a=1)
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
        log(session, a=1)
        log_media(session, "b", lambda: wandb.Image("no such file.png"))
        log(session, 1, a=2)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("W&B: nothing more is logged (")
    (file,) = offline_runs(tmp_path)
    assert [row["a"] for row in history(file)] == [1]


def test_nothing_of_the_user_or_the_machine_is_written_down(home: Path) -> None:
    directory = home / "work" / "runs" / "mine"
    checkpoint = directory / "best.pt"
    with open_session(directory) as session:
        checkpoint.write_bytes(b"weights")
        log(session, number=1.0)
        log_media(session, "table", lambda: wandb.Table(columns=["a"], data=[[1]]))
        log_media(session, "report", lambda: wandb.Html("<p>report</p>", inject=False))
        session.attempt(lambda run: run.model({"best": checkpoint}, {"episodes": 1}))
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
        log(session, a=1)
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"W&B: {file} is damaged: the run that it was for is not known, and cannot be continued"
    )
    assert remembered(tmp_path)["id"] == session.id
    assert len(offline_runs(tmp_path)) == 1


@pytest.fixture
def own_run(home: Path) -> Iterator[wandb.Run]:
    """A run that the caller has begun, and goes on with."""
    settings = wandb.Settings(silent=True, disable_git=True)
    run = wandb.init(mode="offline", dir=home, settings=settings)
    yield run
    assert wandb.run is run
    run.log({"own": 2})
    run.finish()
    (file,) = offline_runs(home)
    assert [row["own"] for row in history(file)] == [1, 2]
    assert recorded(file, "run")[0].run_id == run.id
    assert "run started" in (file.parent / "logs" / "debug.log").read_text()


@pytest.mark.parametrize("fails", [False, True])
def test_a_run_of_the_callers_own_stays_open_beside_the_logged_one(
    home: Path, own_run: wandb.Run, fails: bool
) -> None:
    own_run.log({"own": 1})
    directory = home / "work" / "ours"
    with open_session(directory) as session:
        log(session, a=1)
        if fails:
            log_media(session, "b", lambda: wandb.Image("no such file.png"))
    (file,) = offline_runs(directory)
    assert [row["a"] for row in history(file)] == [1]
    assert recorded(file, "run")[0].run_id == session.id != own_run.id
    assert told_of(home) == []


def test_a_run_of_the_callers_own_survives_that_there_is_no_server(
    home: Path, own_run: wandb.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_run.log({"own": 1})
    monkeypatch.setattr("hyuav.experiments.tracking.wandb_run.SECONDS_TO_BEGIN", 2.0)
    with open_session(home / "work" / "ours", LoggerParameters(mode="online")) as session:
        log(session, a=1)
    (file,) = offline_runs(home / "work" / "ours")
    assert [row["a"] for row in history(file)] == [1]


def test_variables_of_the_environment_are_obeyed_where_nothing_else_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {
        "PROJECT": "theirs",
        "ENTITY": "lab",
        "NAME": "first",
        "RUN_GROUP": "paper",
        "TAGS": "a,b",
        "JOB_TYPE": "study",
        "RUN_ID": "own",
        "DIR": str(tmp_path / "logs"),
    }
    for name, value in asked.items():
        monkeypatch.setenv(f"WANDB_{name}", value)
    for logger in (LoggerParameters(), LoggerParameters(project="ours", name="second")):
        with open_session(tmp_path / "run", logger):
            pass
    first, second = (recorded(file, "run")[0] for file in offline_runs(tmp_path / "logs"))
    assert (first.project, first.entity, first.display_name) == ("theirs", "lab", "first")
    assert (first.run_group, first.job_type, first.run_id) == ("paper", "study", "own")
    assert list(first.tags) == ["a", "b"]
    assert (second.project, second.entity, second.display_name) == ("ours", "lab", "second")
    assert not (tmp_path / "run" / "wandb").exists()
