"""What a batch has flown since its last reset, kept for pictures of it."""

from collections import deque

import torch
from tensordict import TensorDictBase
from torch import Tensor

from hyuav._support.errors import InputError, rejection
from hyuav.envs.arguments import NODES

MOST_SLOTS = 10_000
"""Kept of a flight, more than a picture can show."""


class FlightRecorder:
    """The flights of the first rows of a batch since their last reset, for pictures of them.

    What is kept stays on its device until a picture is drawn. Of a batch that is kept whole it is
    what the environment returned, not a copy, so that a slot costs next to nothing.

    Args:
        rows: how many rows to keep; those of a batch of several dimensions count through all.
        num_slots: T; no more slots are kept.
    """

    def __init__(self, rows: int, num_slots: int) -> None:
        self.rows = rows
        self._slots: deque[dict[str, Tensor]] = deque(maxlen=min(num_slots, MOST_SLOTS) + 1)
        self._names: list[str] = []
        """Of the entries that are drawn."""
        self._count = 0
        """Of the slots flown since all rows were reset."""
        self._begun: list[int] = []
        """How many they were when each row was last reset."""

    def start(self, entries: TensorDictBase, chosen: Tensor | None = None) -> None:
        """Begin flights anew, where nothing is chosen in all rows.

        Args:
            entries: (*B,), what is observed at the start.
            chosen: (*B, 1) bool, the rows that begin anew; the others fly on.
        """
        names = "position", "mode", *NODES
        self._names = [name for name in names if entries.get(name, None) is not None]
        begun = self._first_rows(entries)
        rows = len(begun["position"])
        if chosen is None or not self._slots:
            self._slots.clear()
            self._count, self._begun = 0, [0] * rows
        else:
            anew = chosen.reshape(-1)[:rows]
            last = self._slots.pop()
            begun = {
                name: torch.where(anew.reshape(-1, *(1,) * (own.ndim - 1)), own, last[name])
                for name, own in begun.items()
            }
            pairs = zip(self._begun, anew.tolist(), strict=True)
            self._begun = [self._count if new else before for before, new in pairs]
        self._slots.append(begun)

    def add(self, entries: TensorDictBase) -> None:
        """Add a slot: what is observed after it, (*B,). A graph of a slot keeps nothing."""
        if self._slots and not torch.compiler.is_compiling():
            self._slots.append(self._first_rows(entries))
            self._count += 1

    def flight(self, row: int) -> tuple[Tensor, Tensor, int]:
        """One row's latest slots: positions (t + 1, H, 2) m, modes (t + 1, H), the slots flown.

        The start is the first of them, unless more than T slots were flown.

        Raises:
            InputError: nothing has been flown yet, or ``row`` is not kept.
        """
        if not self._slots:
            raise InputError("nothing to draw: call reset() before render()")
        if not 0 <= row < len(self._begun):
            accepted = f"a row that is kept, 0 to {len(self._begun) - 1}"
            raise InputError(rejection("row", row, accepted))
        flown = self._count - self._begun[row]
        slots = list(self._slots)[-1 - flown :]
        positions, modes = (
            torch.stack([entries[name][row] for entries in slots]).detach().cpu()
            for name in ("position", "mode")
        )
        return positions, modes, flown

    def nodes(self, row: int) -> dict[str, list[list[float]]]:
        """Where the nodes that do not fly are in one row's episode, where they are drawn: in m."""
        latest = self._slots[-1]
        return {name: own[row].tolist() for name, own in latest.items() if name in NODES}

    def _first_rows(self, entries: TensorDictBase) -> dict[str, Tensor]:
        """The first rows of the entries that are drawn, each (rows, ...)."""
        kept, dims = {}, entries.batch_dims
        for name in self._names:
            values = entries.get(name)
            rows = values if dims == 1 else values.reshape(-1, *values.shape[dims:])
            kept[name] = rows if len(rows) <= self.rows else rows[: self.rows].clone()
        return kept
