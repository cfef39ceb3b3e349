"""The program that is running: the words that called it, and when it has been loaded."""

import os
import signal
import sys
from types import FrameType

from hyuav._support.loading import collect_as_ever

called: list[str] = []
"""The words of the command, such as ``hyuav train``; none where Python was given a file to run."""


def program() -> list[str]:
    """The words that call this program again; its arguments go behind them."""
    return called or [sys.orig_argv[0], sys.argv[0]]


def loaded() -> None:
    """End what ``start`` began: Ctrl-C raises KeyboardInterrupt, garbage is collected as ever."""
    collect_as_ever()
    if signal.getsignal(signal.SIGINT) is end_at_once:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def end_at_once(number: int, _: FrameType | None) -> None:
    """Answer a signal while the program is loading."""
    os.write(2, b"interrupted\n")
    os._exit(128 + number)  # an exception could be lost in what is being loaded
