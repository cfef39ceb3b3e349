"""Pieces of work fail alone, whatever becomes of their process."""

import os
import signal
from pathlib import Path

from hyuav.comparison.processes import Workers
from hyuav.errors import InputError


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
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_piece_whose_process_is_killed_is_begun_again(tmp_path: Path) -> None:
    with Workers(2, retries=1) as workers:
        assert list(workers.attempt_all(fall_at_first, [tmp_path / "fell"])) == [
            (tmp_path / "fell", None)
        ]
        reasons = dict(workers.attempt_all(divide, [7, 1]))
    assert reasons == {7: "its process was killed, 2 times", 1: None}
