"""What a batch has flown since its last reset, kept for pictures of it."""

from collections import deque

import torch
from torch import Tensor

from hyuav._support.errors import InputError, rejection

MOST_SLOTS = 10_000
"""Kept of a flight, more than a picture can show."""


class FlightRecorder:
    """The flights of the first rows of a batch since their last reset, for pictures of them.

    Positions and modes stay on their device until a picture is drawn.

    Args:
        rows: how many rows to keep; those of a batch of several dimensions count through all.
        num_slots: T; no more slots are kept.
    """

    def __init__(self, rows: int, num_slots: int) -> None:
        self.rows = rows
        self._slots: deque[tuple[Tensor, Tensor]] = deque(maxlen=min(num_slots, MOST_SLOTS) + 1)
        self._flown: Tensor | None = None
        """(rows,) slots since the last reset."""

    def start(self, position: Tensor, mode: Tensor, chosen: Tensor | None = None) -> None:
        """Begin flights anew, where nothing is chosen in all rows.

        Args:
            position: (*B, 1, 2) m.
            mode: (*B, 1) at the start.
            chosen: (*B, 1) bool, the rows that begin anew; the others fly on.
        """
        begun = self._first_rows(position, mode)
        if chosen is None or self._flown is None:
            self._slots.clear()
            self._flown = torch.zeros(len(begun[1]), dtype=torch.int64, device=mode.device)
        else:
            anew = chosen.reshape(-1)[: self.rows]
            last = self._slots.pop()
            begun = (
                torch.where(anew[:, None], begun[0], last[0]),
                torch.where(anew, begun[1], last[1]),
            )
            self._flown = self._flown.masked_fill(anew, 0)
        self._slots.append(begun)

    def add(self, position: Tensor, mode: Tensor) -> None:
        """Add a slot: ``position`` (*B, 1, 2) m and ``mode`` (*B, 1)."""
        if self._flown is not None:
            self._slots.append(self._first_rows(position, mode))
            self._flown = self._flown + 1

    def flight(self, row: int) -> tuple[Tensor, Tensor, int]:
        """One row's latest slots: positions (t + 1, 2) m, modes (t + 1,), and the slots flown.

        The start is the first of them, unless more than T slots were flown.

        Raises:
            InputError: nothing has been flown yet, or ``row`` is not kept.
        """
        if self._flown is None:
            raise InputError("nothing to draw: call reset() before render()")
        if not 0 <= row < len(self._flown):
            accepted = f"a row that is kept, 0 to {len(self._flown) - 1}"
            raise InputError(rejection("row", row, accepted))
        flown = int(self._flown[row])
        slots = list(self._slots)[-1 - flown :]
        positions, modes = (
            torch.stack([entry[row] for entry in entries]).cpu()
            for entries in zip(*slots, strict=True)
        )
        return positions, modes, flown

    def _first_rows(self, position: Tensor, mode: Tensor) -> tuple[Tensor, Tensor]:
        """Copies (rows, 2) and (rows,), because whoever flies may write to what was returned."""
        first = position.detach().reshape(-1, 2)[: self.rows]
        return first.clone(), mode.detach().reshape(-1)[: self.rows].clone()
