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

    What is kept stays on its device until a picture is drawn.

    Args:
        rows: how many rows to keep; those of a batch of several dimensions count through all.
        num_slots: T; no more slots are kept.
    """

    def __init__(self, rows: int, num_slots: int) -> None:
        self.rows = rows
        self._slots: deque[dict[str, Tensor]] = deque(maxlen=min(num_slots, MOST_SLOTS) + 1)
        self._flown: Tensor | None = None
        """(rows,) slots since the last reset."""

    def start(self, entries: TensorDictBase, chosen: Tensor | None = None) -> None:
        """Begin flights anew, where nothing is chosen in all rows.

        Args:
            entries: (*B,), what is observed at the start.
            chosen: (*B, 1) bool, the rows that begin anew; the others fly on.
        """
        begun = self._first_rows(entries)
        if chosen is None or self._flown is None:
            self._slots.clear()
            mode = begun["mode"]
            self._flown = torch.zeros(len(mode), dtype=torch.int64, device=mode.device)
        else:
            anew = chosen.reshape(-1)[: self.rows]
            last = self._slots.pop()
            begun = {
                name: torch.where(anew.reshape(-1, *(1,) * (own.ndim - 1)), own, last[name])
                for name, own in begun.items()
            }
            self._flown = self._flown.masked_fill(anew, 0)
        self._slots.append(begun)

    def add(self, entries: TensorDictBase) -> None:
        """Add a slot: what is observed after it, (*B,)."""
        if self._flown is not None:
            self._slots.append(self._first_rows(entries))
            self._flown = self._flown + 1

    def flight(self, row: int) -> tuple[Tensor, Tensor, int]:
        """One row's latest slots: positions (t + 1, H, 2) m, modes (t + 1, H), the slots flown.

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
            torch.stack([entries[name][row] for entries in slots]).cpu()
            for name in ("position", "mode")
        )
        return positions, modes, flown

    def nodes(self, row: int) -> dict[str, list[list[float]]]:
        """Where the nodes that do not fly are in one row's episode, where they are drawn: in m."""
        latest = self._slots[-1]
        return {name: latest[name][row].tolist() for name in NODES if name in latest}

    def _first_rows(self, entries: TensorDictBase) -> dict[str, Tensor]:
        """Copies (rows, ...), because whoever flies may write to what was returned."""
        batch = entries.batch_size
        return {
            name: entries[name]
            .detach()
            .reshape(-1, *entries[name].shape[len(batch) :])[: self.rows]
            .clone()
            for name in ("position", "mode", *NODES)
            if name in entries.keys()  # noqa: SIM118 - a tensordict's own test is by its keys
        }
