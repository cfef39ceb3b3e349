"""Pieces of work fail alone, whatever becomes of their process."""

import os
import signal
from pathlib import Path

from hyuav._support.errors import InputError
from hyuav._support.interruption import Interruption
from hyuav.experiments.comparison.processes import Workers


def divide(number: int) -> None:
    if number == 9:
        raise InputError("number = 9: expected another")
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    1 / number


REASONS = {
    0: "ZeroDivisionError: division by zero",
    1: None,
    9: "number = 9: expected another",
    2: None,
}


def test_pieces_that_fail_say_why() -> None:
    with Workers(1) as workers:
        assert dict(workers.attempt_all(divide, list(REASONS))) == REASONS
        assert list(workers.attempt_all(divide, [])) == []


def test_a_process_that_is_killed_takes_no_other_work_with_it() -> None:
    reasons = {7: "its process was killed", **REASONS}
    with Workers(2) as workers:
        assert list(workers.attempt_all(divide, [])) == []
        assert dict(workers.attempt_all(divide, list(reasons))) == reasons


def fall_at_first(file: Path) -> None:
    if not file.exists():
        file.touch()
        os.kill(os.getpid(), signal.Signals[file.name])


def stop_at_first(file: Path) -> None:
    if not file.exists():
        file.touch()
        with Interruption() as interruption:
            os.kill(os.getpid(), signal.SIGTERM)
            interruption.raise_if_requested("so far")


def test_a_piece_whose_process_is_killed_is_begun_again(tmp_path: Path) -> None:
    falling = [tmp_path / name for name in ("SIGKILL", "SIGTERM")]
    stopping = tmp_path / "of another" / "SIGTERM"
    stopping.parent.mkdir()
    with Workers(2, retries=1) as workers:
        assert dict(workers.attempt_all(fall_at_first, falling)) == dict.fromkeys(falling)
        assert list(workers.attempt_all(stop_at_first, [stopping])) == [(stopping, None)]
        assert all(file.exists() for file in (*falling, stopping))
        reasons = dict(workers.attempt_all(divide, [7, 1]))
    assert reasons == {7: "its process was killed, 2 times", 1: None}
