"""Workers, one process for each entry, and how they are measured in turn."""

import contextlib
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from benchmarks import worker as program
from benchmarks.work import Work
from hyuav._support.errors import InputError

Row = dict[str, Any]
"""One measurement, as it stands in the table that is kept."""


@dataclass(frozen=True)
class Entry:
    """Who does which work."""

    name: str
    """One of :data:`benchmarks.worker.ENTRIES`."""
    work: Work

    def with_threads(self, threads: int) -> Self:
        """The same with another number of threads."""
        return dataclasses.replace(self, work=dataclasses.replace(self.work, threads=threads))

    def row(self, part: str) -> Row:
        """What identifies it in the table."""
        work = self.work
        return {
            "part": part,
            "entry": self.name,
            "device": work.device,
            "learners": work.learners,
            "helpers": work.helpers,
            "num_ues": work.scenario.num_ues,
            "num_slots": work.scenario.num_slots,
            "threads": work.threads,
        }


class Worker:
    """A process of its own for one entry, so that libraries and threads do not disturb others.

    Args:
        entry: that lives in it.
        cache: directory in which it finds what was compiled before; None for an empty one.

    Raises:
        InputError: the entry's libraries cannot be imported.
    """

    def __init__(self, entry: Entry, cache: str | None = None) -> None:
        self.entry = entry
        self.facts: Row = {}
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed with the process
        self._cache = tempfile.TemporaryDirectory()  # nothing is compiled beforehand
        begun = time.perf_counter()
        self._process = subprocess.Popen(
            [sys.executable, str(Path(program.__file__)), entry.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=os.environ
            | _environment(entry.work.threads)
            | {"TORCHINDUCTOR_CACHE_DIR": cache or self._cache.name},
            text=True,
        )
        self._answer()
        self.facts["start_up_seconds"] = time.perf_counter() - begun

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error: object, *_: object) -> None:
        if error is None:
            self.stop()
        else:  # it may never answer
            self._process.kill()
            self._close()

    def _answer(self) -> Row:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {"error": self._last_words()}
        if "error" in answer:
            self._process.kill()
            self._close()
            raise InputError(f"{self.entry.name} cannot be run: {answer['error']}")
        return dict(answer)

    def _last_words(self) -> str:
        self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().strip().splitlines() or ["no reason given"]
        return f"exit status {self._process.returncode}, {lines[-1]}"

    def ask(self, **command: Any) -> Row:
        """Give a command and wait for its answer.

        Raises:
            InputError: the entry failed.
        """
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # then the answer says why
            self._process.stdin.write(json.dumps(command) + "\n")
            self._process.stdin.flush()
        return self._answer()

    def start(self, entry: Entry | None = None) -> Row:
        """Build the entry, or another of the same name, and warm it up."""
        self.entry = entry or self.entry
        self.facts |= self.ask(do="start", work=self.entry.work.to_dict())
        return self.facts

    def measure(self, part: str, seconds: float, number: int) -> Row:
        """Advance for ``seconds`` and tell the rate, as round ``number`` of ``part``."""
        ran = self.ask(do="run", seconds=seconds)
        rate = ran["steps"] / ran["seconds"]
        return {**self.entry.row(part), "round": number, **ran, "steps_per_second": rate}

    def stop(self) -> Row:
        """End the process; tell its start-up, warm-up and peak memory."""
        if self._process.poll() is None:
            self.facts |= self.ask(do="stop")
        self._close()
        return self.facts

    def _close(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout, self._errors):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()
        self._process.wait()
        self._cache.cleanup()


def _environment(threads: int) -> dict[str, str]:
    """Variables that hold every library to ``threads`` threads."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    variables = dict.fromkeys(names, str(threads)) | {"PYTHONUNBUFFERED": "1"}
    if threads == 1:
        flags = os.environ.get("XLA_FLAGS", "")
        variables["XLA_FLAGS"] = f"{flags} --xla_cpu_multi_thread_eigen=false".strip()
    return variables


@contextlib.contextmanager
def at_best_threads(entry: Entry, threads: Sequence[int], seconds: float) -> Iterator[Worker]:
    """A worker, warmed up, with the number of threads at which the entry is fastest.

    Args:
        entry: to try.
        threads: to try it with.
        seconds: of each trial.
    """
    with contextlib.ExitStack() as stack:
        rates = {}
        for number in threads:
            candidate = stack.enter_context(Worker(entry.with_threads(number)))
            candidate.start()
            if len(threads) == 1:  # nothing to compare it with
                yield candidate
                return
            rates[candidate] = candidate.measure("trial", seconds, 0)["steps_per_second"]
        best = max(rates, key=lambda candidate: rates[candidate])
        for candidate in rates:
            if candidate is not best:
                candidate.stop()
        yield best


def alternate(part: str, workers: Sequence[Worker], rounds: int, seconds: float) -> list[Row]:
    """Measure the workers in turn, round after round: only one of them runs at a time."""
    measured = [
        (worker, worker.measure(part, seconds, number))
        for number in range(1, rounds + 1)
        for worker in workers
    ]
    for worker in workers:
        worker.stop()
    return [row | worker.facts for worker, row in measured]


def job_seconds(part: str, entry: Entry, number: int, cache: str | None = None) -> Row:
    """A whole training from the start of its process to its end; see :class:`Worker`."""
    begun = time.perf_counter()
    with Worker(entry, cache) as process:
        done = process.ask(do="job", work=entry.work.to_dict())
    seconds = time.perf_counter() - begun
    steps = done["slots"] * entry.work.learners
    rate = {"steps": steps, "seconds": seconds, "steps_per_second": steps / seconds}
    return {**entry.row(part), "round": number, **rate, **process.facts}
