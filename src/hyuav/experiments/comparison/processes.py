"""Independent pieces of work, several at a time, of which one that fails stops no other."""

import multiprocessing
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Self, TypeVar

import torch

from hyuav._support.errors import InputError
from hyuav._support.loading import collect_as_ever

Piece = TypeVar("Piece")


class Workers:
    """Processes that work at the same time, on one thread each; use it as a context manager.

    Args:
        number: of processes; with one, it is this process.
        retries: how often a piece is begun again whose process was killed.
    """

    def __init__(self, number: int, retries: int = 0) -> None:
        self._number, self._retries = number, retries
        self._is_ending = False
        self._threads = ThreadPoolExecutor(number)
        # One process each: if it is killed, for want of memory perhaps, only its work is lost.
        self._idle: queue.SimpleQueue[ProcessPoolExecutor] = queue.SimpleQueue()
        for _ in range(number):
            self._idle.put(_process())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: object, *_: object) -> None:
        self._threads.shutdown(wait=error is None, cancel_futures=True)
        if error is not None:  # what is under way may take hours
            self._is_ending = True
            for child in multiprocessing.active_children():
                child.terminate()
            self._threads.shutdown()
        while not self._idle.empty():
            self._idle.get().shutdown()

    def attempt_all(
        self, function: Callable[[Piece], None], pieces: Sequence[Piece]
    ) -> Iterator[tuple[Piece, str | None]]:
        """Do each piece of work; yield it when it is done, with one line of why if it failed.

        Args:
            function: does a piece; another process can find it by its name.
            pieces: of work.
        """
        if self._number == 1:
            for piece in pieces:
                yield piece, attempt(function, piece)
            return
        begun = {self._threads.submit(self._elsewhere, function, own): own for own in pieces}
        for done in as_completed(begun):
            yield begun[done], done.result()

    def _elsewhere(self, function: Callable[[Piece], None], piece: Piece) -> str | None:
        process, tries = self._idle.get(), 0
        try:
            while tries <= self._retries and not self._is_ending:
                tries += 1
                try:
                    return process.submit(attempt, function, piece).result()
                except (BrokenProcessPool, KeyboardInterrupt, SystemExit):  # of the worker
                    process.shutdown()
                    process = _process()
            return "its process was killed" + (f", {tries} times" * (tries > 1))
        finally:
            self._idle.put(process)


def _process() -> ProcessPoolExecutor:
    """One process, which starts when it is given work."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=_begin)


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is the first process that ends the others
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # TorchRL's replay has locks. Those of "spawn" have names, which are left if it is killed.
    if "fork" in multiprocessing.get_all_start_methods():
        multiprocessing.set_start_method("fork", force=True)
    collect_as_ever()  # its program has been loaded, as that of the first process
    settle()


def _end_with_parent() -> None:
    """Leave no orphan at work on what the next comparison will take up."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def settle() -> None:
    """Make a worker of this process: one thread."""
    torch.set_num_threads(1)


def attempt(function: Callable[[Piece], None], piece: Piece) -> str | None:
    """Do a piece of work; one line of why if it failed."""
    try:
        function(piece)
    except Exception as error:
        return reason(error)
    return None


def reason(error: Exception) -> str:
    """One line of why a piece of work failed."""
    if isinstance(error, InputError | ChildProcessError):
        return str(error)
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
