"""Files that are read whatever they are, and are written whole or stay as they were.

What is read may be of unknown origin: a pipe would be waited for, and a device may have no end.
"""

import contextlib
import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import BinaryIO

import pandas as pd
import torch
from pyarrow.lib import ArrowException

from hyuav._support.errors import InputError, one_line, rejection
from hyuav._support.machine import device_memory

READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""Without waiting for a pipe where there are any, and without Windows' other line ends."""


def open_regular(path: Path) -> BinaryIO:
    """A file to read from that is one, also at the end of a link, and fits the memory.

    Raises:
        OSError: there is none, it cannot be read, or it is a directory, a pipe or a device.
    """
    number = os.open(path, READING)
    state = os.fstat(number)
    if not stat.S_ISREG(state.st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "not a file", str(path))
    if state.st_size > device_memory(torch.device("cpu")):
        os.close(number)
        raise OSError(errno.EFBIG, "larger than the memory", str(path))
    return os.fdopen(number, "rb")


def read_regular(path: Path, size: int = -1) -> bytes:
    """The first bytes of such a file, or all.

    Args:
        path: of the file.
        size: how many at most.

    Raises:
        OSError: as :func:`open_regular`.
    """
    with open_regular(path) as file:
        available = os.fstat(file.fileno()).st_size
        return file.read(min(size, available) if size >= 0 else -1)


def read_parquet(path: Path, accepted: str, columns: list[str] | None = None) -> pd.DataFrame:
    """The table of a Parquet file.

    Args:
        path: of the file.
        accepted: what would be accepted there, for the refusal.
        columns: that are read; None for all.

    Raises:
        InputError: there is none, it is damaged, or a column is missing.
    """
    try:
        return pd.read_parquet(path, columns=columns)
    except (OSError, ValueError, TypeError, LookupError, ArrowException) as error:
        reason = one_line(str(error))[:200]
        raise InputError(f"{path}: expected {accepted} in Parquet ({reason})") from None


def write_all(file: FileIO, content: bytes | memoryview) -> None:
    """Write to an unbuffered file until nothing is left, or the system refuses.

    Raises:
        OSError: with the file's name, such as for want of space.
    """
    left = memoryview(content)
    try:
        while left:
            left = left[file.write(left) :]
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file.name)) from None


def require_writable(name: str, directory: Path) -> None:
    """Accept a directory that can be written to; make it where there is none.

    Raises:
        InputError: it cannot be made or written to.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        accepted = f"a writable place ({error.strerror})"
        raise InputError(rejection(name, str(directory), accepted)) from None


def write_durably(path: Path, content: bytes | memoryview, keep: Path | None = None) -> None:
    """Replace a file by another content in one step, which a loss of power outlasts.

    Args:
        path: of the file.
        content: of it.
        keep: where the file that is replaced goes to; it is lost where this is None.

    Raises:
        OSError: it cannot be written; then what was there still is.
    """
    with _written_beside(path, content) as partial:
        if keep is not None and path.exists():
            path.replace(keep)
        partial.replace(path)


def create_durably(path: Path, content: bytes) -> None:
    """Make a file that was not there, whole from the first moment.

    Raises:
        FileExistsError: there is one.
        OSError: it cannot be written.
    """
    if path.exists():
        raise FileExistsError(str(path))
    with _written_beside(path, content) as partial:
        try:
            path.hardlink_to(partial)  # which never replaces another's
        except FileExistsError:
            raise
        except OSError:  # where there are no links
            partial.replace(path)


@contextmanager
def _written_beside(path: Path, content: bytes | memoryview) -> Iterator[Path]:
    """A file of this content beside ``path``, to be given that name; it is removed otherwise.

    Raises:
        OSError: in which the file is called ``path``.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.partial")
    try:
        with partial.open("wb", buffering=0) as file:
            write_all(file, content)
            os.fsync(file.fileno())
        yield partial
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
    _sync_directory(path.parent)


def rename_durably(directory: Path, to: Path) -> None:
    """Rename a directory whose files are synced; its name outlasts a loss of power.

    Raises:
        OSError: it cannot be renamed.
    """
    directory.rename(to)
    _sync_directory(to.parent)


def _sync_directory(directory: Path) -> None:
    """Let names outlast a loss of power, where the system can do this for a directory."""
    with contextlib.suppress(OSError):
        number = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
