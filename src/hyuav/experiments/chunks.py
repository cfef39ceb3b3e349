"""Work on many scenarios, some at a time: each part is done once and kept in a file of its own."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from rich.console import Console

from hyuav._support.errors import Halted
from hyuav._support.terminal import make_progress
from hyuav.experiments.comparison.processes import Workers


class Chunk(Protocol):
    """A part of the work."""

    @property
    def file(self) -> Path:
        """What comes of it; where it exists, the part is done."""


Part = TypeVar("Part", bound=Chunk)


def ranges(first: int, count: int, size: int) -> Iterator[range]:
    """The seeds from ``first`` on, at most ``size`` at a time."""
    last = first + count
    return (range(seed, min(seed + size, last)) for seed in range(first, last, size))


def do_missing(
    function: Callable[[Part], None],
    chunks: Sequence[Part],
    workers: Workers,
    console: Console,
    description: str,
) -> None:
    """Do the parts whose files are missing.

    Args:
        function: does a part and writes its file; another process can find it by its name.
        chunks: all parts.
        workers: that do them.
        console: on which a terminal shows the progress.
        description: of the parts.

    Raises:
        Halted: a part failed; what is done is kept.
    """
    left = [chunk for chunk in chunks if not chunk.file.exists()]
    with make_progress(console, description) as progress, workers:
        task = progress.add_task("", total=len(chunks), completed=len(chunks) - len(left))
        for _, reason in workers.attempt_all(function, left):
            if reason is not None:
                raise Halted(f"failed: {reason}; what is done is kept")
            progress.advance(task)
