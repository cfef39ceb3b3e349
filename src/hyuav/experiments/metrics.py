"""``metrics.csv``: a row for each episode and learner, read also while it is written."""

import csv
import io
import os
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd

from hyuav._support.errors import InputError, rejection
from hyuav._support.files import open_regular, read_regular, write_all, write_durably
from hyuav.physics.modes import MODE_RULES

METRIC_COLUMNS = (
    "episode",
    "slots",
    "learner",
    "scheme",
    "seed",
    "num_slots",
    "accumulated_reward",
    "evaluation",
    "sum_rate",
    "best_evaluation",
    "seconds",
)
"""Columns of ``metrics.csv``; the mean loss of each gradient step follows.

``evaluation`` is noise-free, ``sum_rate`` the secrecy sum-rate of the same flights.
"""

METRIC_NUMBERS = frozenset(METRIC_COLUMNS) - {"scheme"}
"""Those of them that hold numbers."""

NEEDED = ("episode", "slots", "learner", "scheme", "num_slots")
"""Columns without which a table is not read."""

IDENTITY = ("episode", "learner", "scheme")
"""Columns without which a row says nothing."""

_LONGEST_HEADER = 2**20
"""Bytes of the first line that are read."""

_REMEMBERED = 256
"""Bytes before the place that was read to, by which a file that was replaced is noticed."""


@dataclass(frozen=True)
class MetricsPosition:
    """The beginning of a ``metrics.csv``: what a checkpoint knows of it."""

    size: int = 0
    """In bytes."""
    checksum: int = 0
    """CRC-32."""

    def after(self, content: bytes) -> "MetricsPosition":
        """The position when this is appended."""
        return MetricsPosition(self.size + len(content), zlib.crc32(content, self.checksum))

    def is_in(self, path: Path) -> bool:
        """Whether a file begins as it did."""
        try:
            begun = read_regular(path, self.size)
        except OSError:
            begun = b""
        return len(begun) == self.size and zlib.crc32(begun) == self.checksum


class MetricsFile:
    """A ``metrics.csv`` to which rows are appended as training goes on.

    Args:
        path: of the file.
        columns: in their order.
        begun: what is kept of it; the file is begun anew by default.

    Raises:
        OSError: it cannot be written.
    """

    def __init__(
        self, path: Path, columns: tuple[str, ...], begun: MetricsPosition | None = None
    ) -> None:
        self._columns = columns
        self.position = begun or MetricsPosition()
        self._file = path.open("ab", buffering=0)
        self._file.truncate(self.position.size)
        if self.position.size == 0:
            self.append([dict(zip(columns, columns, strict=True))])

    def append(self, rows: list[dict[str, Any]]) -> None:
        """Add rows; they can be read at once."""
        text = io.StringIO(newline="")
        csv.DictWriter(text, self._columns, restval="").writerows(rows)
        content = text.getvalue().encode()
        write_all(self._file, content)
        self.position = self.position.after(content)

    def sync(self) -> None:
        """Return when the rows outlast a loss of power."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """No more rows follow."""
        self._file.close()


def remove_damaged_rows(path: Path, episodes: int) -> MetricsPosition:
    """Keep of a damaged ``metrics.csv`` the header and whole rows, as they were written.

    Args:
        path: of the file.
        episodes: whose rows are kept.

    Returns:
        the end of the file.

    Raises:
        OSError: it cannot be written.
    """
    lines = read_regular(path).splitlines(keepends=True) if path.exists() else []
    content = b""  # without a header nobody knows what the rows are
    if lines and lines[0].startswith(",".join(METRIC_COLUMNS).encode()):
        width = len(lines[0].split(b","))
        whole = [line for line in lines[1:] if _is_whole(line, width, episodes)]
        content = b"".join([lines[0], *whole])
    write_durably(path, content)
    return MetricsPosition().after(content)


def _is_whole(line: bytes, width: int, episodes: int) -> bool:
    cells = line.strip().split(b",")
    scheme = METRIC_COLUMNS.index("scheme")
    try:
        numbers = [float(cell) for cell in (*cells[:scheme], *cells[scheme + 1 :]) if cell]
        return len(cells) == width and line.endswith(b"\n") and numbers[0] <= episodes
    except (ValueError, IndexError):
        return False


def read_metrics(path: Path) -> pd.DataFrame:
    """The rows of a training that is not under way, of which none may be damaged.

    Raises:
        InputError: there is no such table, or it is damaged.
    """
    try:
        with open_regular(path) as file:
            metrics = pd.read_csv(file)
        whole = set(METRIC_COLUMNS) <= set(metrics.columns) and (
            metrics.empty
            or (
                set(metrics.select_dtypes("number")) >= METRIC_NUMBERS  # truth values are none
                and metrics["scheme"].isin(MODE_RULES).all()
            )
        )
        if whole:
            return metrics
        reason = "damaged"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "damaged"
    accepted = f"the table that a training writes ({reason})"
    raise InputError(rejection("metrics", str(path), accepted))


def readable_metrics(path: str | Path) -> pd.DataFrame:
    """What can be read of a ``metrics.csv``, also while it is being written.

    A file that is missing, empty or another program's has no rows; a row cut off in the middle, or
    damaged, is left out. Every column of :data:`METRIC_COLUMNS` is there, all finite or NaN but
    ``scheme``.

    Args:
        path: of the file.
    """
    try:
        rows = GrowingMetrics(Path(path)).read()
    except InputError:
        rows = pd.DataFrame()
    return rows.reindex(columns=list(dict.fromkeys([*METRIC_COLUMNS, *rows.columns])))


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
        try:
            with open_regular(self.path) as file:
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
            self._columns = _columns(self.path, header)
        if lines:
            rows = parse_rows(lines, self._columns)
            self._rows = pd.concat([self._rows, rows], ignore_index=True)


def last_metrics(path: Path, size: int) -> pd.DataFrame:
    """The rows in the last bytes of a ``metrics.csv``, whole ones only; none if there is no table.

    Args:
        path: of the file.
        size: in bytes.

    Raises:
        OSError: it cannot be read.
    """
    with open_regular(path) as file:
        header = file.readline(_LONGEST_HEADER)
        begin = max(file.seek(0, os.SEEK_END) - size, len(header))
        file.seek(begin)
        lines = file.read()
    if begin > len(header):
        lines = lines[lines.find(b"\n") + 1 :]
    try:
        return parse_rows(lines[: lines.rfind(b"\n") + 1], _columns(path, header))
    except InputError:
        return pd.DataFrame()


def _columns(path: Path, header: bytes) -> list[str]:
    """The names in a header line that has all of :data:`NEEDED`.

    Raises:
        InputError: it lacks some, or names one twice.
    """
    columns = header.decode("utf-8", "replace").strip().split(",")
    if not set(NEEDED) <= set(columns) or len(set(columns)) < len(columns):
        accepted = f"columns that differ, among them {', '.join(NEEDED)}"
        raise InputError(rejection(f"{path.name} header", header[:80], accepted))
    return columns


def parse_rows(lines: bytes, columns: Sequence[str]) -> pd.DataFrame:
    """Rows from whole lines: numbers, but for ``scheme``; what is no finite number is NaN.

    A line that has not a value or nothing for each column, or that lacks its :data:`IDENTITY`, is
    left out.

    Args:
        lines: each with its end of line.
        columns: of the table, :data:`IDENTITY` among them.
    """
    whole = [
        line
        for line in lines.replace(b"\0", b"").splitlines()
        if line.count(b",") == len(columns) - 1
    ]
    rows = pd.read_csv(
        io.BytesIO(b"\n".join([",".join(columns).encode(), *whole])),
        index_col=False,
        encoding_errors="replace",
        quoting=csv.QUOTE_NONE,
        dtype={"scheme": str},
        low_memory=False,
    )
    for name in rows.columns.drop("scheme"):
        rows[name] = finite_numbers(rows[name])
    return rows.dropna(subset=list(IDENTITY)).reset_index(drop=True)


def finite_numbers(column: "pd.Series[Any]") -> "pd.Series[float]":
    """A column as float64, in which whatever is no finite number is NaN."""
    try:
        numbers = pd.to_numeric(column, errors="coerce").astype("float64")
    except OverflowError:  # a whole number of hundreds of digits
        written = column.astype(str)
        numbers = pd.to_numeric(written.where(written.str.len() < 300), errors="coerce")
        numbers = numbers.astype("float64")
    return numbers.where(np.isfinite(numbers))
