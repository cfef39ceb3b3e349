"""Reading files of unknown origin: a pipe would be waited for, and a device may have no end."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

import pandas as pd
import torch
from pyarrow.lib import ArrowException

from hyuav._support.errors import InputError, one_line
from hyuav._support.machine import device_memory


def open_regular(path: Path) -> BinaryIO:
    """A file to read from that is one, also at the end of a link, and fits the memory.

    Raises:
        OSError: there is none, it cannot be read, or it is a directory, a pipe or a device.
    """
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
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
