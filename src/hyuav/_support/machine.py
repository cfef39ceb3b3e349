"""What the machine has: processor cores, memory, installed libraries."""

import importlib.util
import math
import os
from collections.abc import Iterable

import torch

from hyuav._support.errors import InputError


def cores() -> int:
    """Processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def device_memory(device: torch.device) -> float:
    """Bytes that the device has; infinity where that cannot be known."""
    if device.type == "cuda":
        return float(torch.cuda.get_device_properties(device).total_memory)
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def require_installed(libraries: Iterable[str], extra: str) -> None:
    """Accept libraries that can be imported.

    Args:
        libraries: by the names under which they are imported.
        extra: of this package that brings them.

    Raises:
        InputError: naming those that cannot, and how to get them.
    """
    missing = [library for library in libraries if not _can_be_found(library)]
    if missing:
        names = ", ".join(missing)
        raise InputError(f"{names} cannot be imported: pip install 'hyuav[{extra}]'")


def _can_be_found(library: str) -> bool:
    try:
        return importlib.util.find_spec(library) is not None
    except (ImportError, ValueError):
        return False
