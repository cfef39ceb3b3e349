"""Reading ``metrics.csv`` again and again while a training writes it."""

from pathlib import Path
from typing import BinaryIO

import pandas as pd

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.metrics import parse_rows

NEEDED = ("episode", "slots", "learner", "scheme", "num_slots")
"""Columns without which there is nothing to draw."""

_REMEMBERED = 256
"""Bytes before the place that was read to, by which a file that was replaced is noticed."""


class GrowingMetrics:
    """The rows of a ``metrics.csv``, of which each reading parses only what is new.

    A line counts once it ends, so that a file can be read in the midst of a write or after a
    training was cut off. A file that was replaced is read anew.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._restart()

    def _restart(self) -> None:
        self._offset, self._before = 0, b""
        self._columns: list[str] = []
        self._rows = pd.DataFrame()

    def read(self) -> pd.DataFrame:
        """All rows that are complete, numeric except for ``scheme``.

        Raises:
            InputError: the file cannot be opened, or its columns are not those of a training.
        """
        if self.path.exists() and not self.path.is_file():  # a device may have no end
            raise InputError(rejection("metrics", str(self.path), "a file"))
        try:
            with self.path.open("rb") as file:
                if not self._continues(file):
                    self._restart()
                file.seek(self._offset)
                new = file.read()
        except OSError as error:
            accepted = f"a file that can be read ({error.strerror})"
            raise InputError(rejection("metrics", str(self.path), accepted)) from None
        complete = new[: new.rfind(b"\n") + 1]
        if complete:
            self._append(complete)
            self._offset += len(complete)
            self._before = (self._before + complete)[-_REMEMBERED:]
        return self._rows

    def _continues(self, file: BinaryIO) -> bool:
        """Whether the file still begins with what was read of it."""
        file.seek(self._offset - len(self._before))
        return file.read(len(self._before)) == self._before

    def _append(self, lines: bytes) -> None:
        if not self._columns:
            header, _, lines = lines.partition(b"\n")
            self._columns = require_columns(self.path, header)
        if lines:
            self._rows = pd.concat(
                [self._rows, parse_rows(lines, self._columns)], ignore_index=True
            )


def require_columns(path: Path, header: bytes) -> list[str]:
    """The names in a header line that has all of :data:`NEEDED`.

    Raises:
        InputError: it lacks some, or names one twice.
    """
    columns = header.decode("utf-8", "replace").strip().split(",")
    missing = [name for name in NEEDED if name not in columns]
    if missing or len(set(columns)) < len(columns):
        accepted = f"columns that differ, among them {', '.join(NEEDED)}"
        raise InputError(rejection(f"{path.name} header", header[:80], accepted))
    return columns
