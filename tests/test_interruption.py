import os
import signal
import threading

import pytest

from hyuav.errors import Interrupted
from hyuav.interruption import Interruption, interrupted_by_sigterm

in_main_thread = pytest.mark.skipif(
    threading.current_thread() is not threading.main_thread(), reason="where signals arrive"
)


@in_main_thread
def test_a_termination_interrupts_and_afterwards_is_one_again() -> None:
    with pytest.raises(Interrupted, match="interrupted") as caught, interrupted_by_sigterm():
        os.kill(os.getpid(), signal.SIGTERM)
    assert caught.value.signal == signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


@in_main_thread
def test_a_training_inside_is_asked_first_and_stops_when_it_may() -> None:
    with interrupted_by_sigterm(), Interruption() as interruption:
        os.kill(os.getpid(), signal.SIGTERM)
    assert interruption.requested
    with pytest.raises(Interrupted, match="after episode 3"):
        interruption.raise_if_requested("after episode 3")


@in_main_thread
def test_a_signal_that_is_ignored_stays_so() -> None:
    former = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with interrupted_by_sigterm(), Interruption() as interruption:
            os.kill(os.getpid(), signal.SIGTERM)
        assert not interruption.requested
    finally:
        signal.signal(signal.SIGTERM, former)
