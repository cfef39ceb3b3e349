import os
import signal
from collections.abc import Iterator

import pytest

from hyuav._support.errors import Interrupted
from hyuav._support.interruption import Interruption, interrupted_by_sigterm


@pytest.fixture
def _not_ignored() -> Iterator[None]:
    """Let SIGINT interrupt, which a shell's background process is made to ignore."""
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, former)


@pytest.mark.usefixtures("_not_ignored")
def test_the_first_signal_is_remembered_and_the_second_obeyed() -> None:
    with Interruption() as interruption:
        interruption.raise_if_requested("nothing yet")
        os.kill(os.getpid(), signal.SIGTERM)
        assert interruption.requested
        with pytest.raises(KeyboardInterrupt, match="so far") as stopped:
            interruption.raise_if_requested("so far")
        assert stopped.value.signal == signal.SIGTERM  # type: ignore[attr-defined]
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_a_termination_interrupts_and_afterwards_is_one_again() -> None:
    with pytest.raises(Interrupted, match="interrupted") as caught, interrupted_by_sigterm():
        os.kill(os.getpid(), signal.SIGTERM)
    assert caught.value.signal == signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_training_inside_is_asked_first_and_stops_when_it_may() -> None:
    with interrupted_by_sigterm(), Interruption() as interruption:
        os.kill(os.getpid(), signal.SIGTERM)
    assert interruption.requested
    with pytest.raises(Interrupted, match="after episode 3"):
        interruption.raise_if_requested("after episode 3")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_is_ignored_stays_so(number: signal.Signals) -> None:
    former = signal.signal(number, signal.SIG_IGN)
    try:
        with interrupted_by_sigterm(), Interruption() as interruption:
            signal.raise_signal(number)
        assert not interruption.requested
    finally:
        signal.signal(number, former)


def test_a_signal_that_the_program_answers_itself_is_left_to_it() -> None:
    """As submitit does in a job of SLURM, which is asked twice before it is taken away."""
    received: list[int] = []
    former = signal.signal(signal.SIGTERM, lambda number, _: received.append(number))
    try:
        with interrupted_by_sigterm(), Interruption() as interruption:
            signal.raise_signal(signal.SIGTERM)
        assert received == [signal.SIGTERM]
        assert not interruption.requested
    finally:
        signal.signal(signal.SIGTERM, former)
