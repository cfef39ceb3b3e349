"""Stopping at a good moment when the system or the user asks to stop."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

from hyuav._support.errors import Interrupted

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def _interrupt(number: int, _: FrameType | None) -> None:
    raise Interrupted("interrupted", number)


USUAL = (signal.SIG_DFL, signal.default_int_handler, _interrupt)
"""What a signal does that nobody else has a use for: end or interrupt the program."""


class Interruption:
    """Remember a request to stop instead of obeying at once; use it as a context manager.

    The first SIGINT or SIGTERM is remembered, the second does what it would have done before. A
    signal that is ignored stays so, and one that the program around answers in a way of its own is
    left to it: a job of SLURM passes over the SIGTERM before another signal, which puts it back
    into the queue. Only the main thread can be interrupted.
    """

    def __init__(self) -> None:
        self._former: dict[signal.Signals, Any] = {}
        self._received: int | None = None

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for each in SIGNALS:
                if signal.getsignal(each) in USUAL:
                    self._former[each] = signal.signal(each, self._remember)
        return self

    def __exit__(self, *_: object) -> None:
        self._restore()

    @property
    def requested(self) -> bool:
        """Whether to stop."""
        return self._received is not None

    def raise_if_requested(self, message: str) -> None:
        """Stop if asked to.

        Args:
            message: how far it came, in one line.

        Raises:
            Interrupted: with the message.
        """
        if self._received is not None:
            raise Interrupted(message, self._received)

    def _remember(self, number: int, _: FrameType | None) -> None:
        self._received = number
        self._restore()

    def _restore(self) -> None:
        while self._former:
            number, handler = self._former.popitem()
            signal.signal(number, handler)


@contextmanager
def interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM interrupt what is done inside, as SIGINT does; it otherwise ends a process.

    Raises:
        Interrupted: in place of the end.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
