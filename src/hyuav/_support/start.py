"""What a program imports before all else, so that it ends in one line while it is still loading.

Loading takes seconds, in which nothing is done that would have to be kept. What is loaded stays, so
that it is seldom searched for garbage, which would take half as long again. Until :func:`.loaded`,
Ctrl-C therefore ends the program at once, with status 130; in the worker of a program it does
nothing, since the program ends its workers. An ``InputError`` that nobody answers ends it with
status 2. A ``ScenarioWarning`` is one line without its place in the code.
"""

import gc
import multiprocessing
import signal
import sys
import warnings
from types import TracebackType
from typing import TextIO

from hyuav._support.errors import InputError, ScenarioWarning
from hyuav._support.loading import SELDOM
from hyuav._support.program import end_at_once


def _tell(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    if not isinstance(error, InputError):
        sys.__excepthook__(kind, error, traceback)
        return
    print(f"error: {error}", file=sys.stderr)
    sys.exit(2)


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    if issubclass(category, ScenarioWarning):  # a line for whoever called the command
        print(f"warning: {message}", file=file or sys.stderr)
        return
    _show(message, category, filename, lineno, file, line)


gc.set_threshold(*SELDOM)
_show, warnings.showwarning = warnings.showwarning, _warn
sys.excepthook = _tell
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # it may be ignored
    is_worker = multiprocessing.parent_process() is not None
    signal.signal(signal.SIGINT, signal.SIG_IGN if is_worker else end_at_once)
