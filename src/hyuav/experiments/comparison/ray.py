"""The work of a comparison done by workers of Ray: on this machine or on many."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Self, TypeVar

from hyuav.experiments.cluster import connected, outcomes
from hyuav.experiments.comparison.processes import attempt, reason, settle

Piece = TypeVar("Piece")


class RayWorkers:
    """Workers of Ray, on one core each; use it as a context manager.

    Those of a cluster must see the files of the pieces under the same names as this process does.

    Args:
        address: of Ray, as :func:`hyuav.experiments.cluster.connected` takes it.
        number: of workers, where they are this machine's.
        retries: how often a piece is begun again whose worker was lost.

    Raises:
        InputError: on entering, there is no Ray at the address.
    """

    def __init__(self, address: str, number: int, retries: int) -> None:
        self._retries = retries
        self._connection = connected(address, number, prints=False)

    def __enter__(self) -> Self:
        self._connection.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.__exit__(None, None, None)

    def attempt_all(
        self, function: Callable[[Piece], None], pieces: Sequence[Piece]
    ) -> Iterator[tuple[Piece, str | None]]:
        """As :meth:`hyuav.experiments.comparison.processes.Workers.attempt_all`."""
        done = outcomes(partial(_attempt, function), pieces, retries=self._retries)
        for piece, outcome in done:
            yield piece, reason(outcome) if isinstance(outcome, Exception) else outcome


def _attempt(function: Callable[[Piece], None], piece: Piece) -> str | None:
    settle()
    return attempt(function, piece)
