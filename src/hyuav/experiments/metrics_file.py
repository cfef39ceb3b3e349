"""Writing ``metrics.csv``, so that an interrupted training can go on in it."""

import csv
import io
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hyuav._support.durable import sync, write_all, write_durably
from hyuav._support.files import read_regular
from hyuav.experiments.run_directory import METRIC_COLUMNS


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


def undamaged_metrics(path: Path, episodes: int) -> MetricsPosition:
    """Remove from a damaged ``metrics.csv`` all but the header and whole rows.

    Args:
        path: of the file.
        episodes: whose rows are kept.

    Returns:
        the end of the file.

    Raises:
        OSError: it cannot be written.
    """
    lines = read_regular(path).splitlines(keepends=True) if path.exists() else []
    width = len(lines[0].split(b",")) if lines else 0
    whole = [line for line in lines[1:] if _is_whole(line, width, episodes)]
    content = b"".join([*lines[:1], *whole])
    if not content.startswith(",".join(METRIC_COLUMNS).encode()):
        content = b""  # without a header nobody knows what the rows are
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


class MetricsFile:
    """``metrics.csv``, to which rows are appended as training goes on.

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
            self._write([dict(zip(columns, columns, strict=True))])

    def append(self, rows: list[dict[str, Any]]) -> None:
        """Add rows; they can be read at once."""
        self._write(rows)

    def sync(self) -> None:
        """Return when the rows outlast a loss of power."""
        sync(self._file)

    def close(self) -> None:
        """No more rows follow."""
        self._file.close()

    def _write(self, rows: list[dict[str, Any]]) -> None:
        text = io.StringIO(newline="")
        csv.DictWriter(text, self._columns, restval="").writerows(rows)
        content = text.getvalue().encode()
        write_all(self._file, content)
        self.position = self.position.after(content)
