"""Checkpoint files: written whole or not at all, read without running code from them."""

import io
import zipfile
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from hyuav._support.errors import InputError, brief, rejection
from hyuav._support.files import read_regular, write_durably

FORMAT = "hyuav-checkpoint-1"


def save_checkpoint(
    path: Path, kind: str, content: dict[str, Any], keep: Path | None = None
) -> None:
    """Write tensors and plain values; an interrupted write leaves an older file as it was.

    Args:
        path: of the file.
        kind: what it holds, "training" or "weights"; a reader asks for it by this word.
        content: tensors and plain values, nested in dicts, lists and tuples.
        keep: where an older file is kept; it is lost where this is None.

    Raises:
        OSError: it cannot be written, for want of space perhaps.
    """
    buffer = io.BytesIO()
    torch.save({"format": FORMAT, "kind": kind, "content": content}, buffer)
    write_durably(path, buffer.getbuffer(), keep)


def load_checkpoint(path: str | Path, kind: str, device: torch.device | str = "cpu") -> Any:
    """Read what :func:`save_checkpoint` wrote under the same ``kind``.

    Raises:
        InputError: no such file, a truncated, damaged or foreign one, one of another kind, or what
            is there is no file but a pipe or a device.
    """
    accepted = f"a checkpoint of kind {kind!r} written by hyuav"
    try:
        stored = _load(Path(path), device)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(rejection("checkpoint", str(path), f"{accepted} ({reason})")) from None
    except Exception:  # what unpickling raises on a foreign file is up to its bytes
        reason = "not a checkpoint, truncated or damaged"
        raise InputError(rejection("checkpoint", str(path), f"{accepted} ({reason})")) from None
    if not isinstance(stored, dict) or stored.get("format") != FORMAT:
        raise InputError(rejection("checkpoint", str(path), f"{accepted} (another program's)"))
    if stored.get("kind") != kind:
        reason = f"this one is of kind {brief(stored.get('kind'))}"
        raise InputError(rejection("checkpoint", str(path), f"{accepted} ({reason})"))
    return stored.get("content")


def _load(path: Path, device: torch.device | str) -> Any:
    content = io.BytesIO(read_regular(path))
    with zipfile.ZipFile(content) as archive:
        damaged = archive.testzip()  # PyTorch does not compare the checksums that it writes
    if damaged is not None:
        raise zipfile.BadZipFile(damaged)
    content.seek(0)
    return torch.load(content, map_location=device, weights_only=True)


def load_weights_file(path: str | Path) -> dict[str, Tensor]:
    """Read the weights of networks, by name.

    Raises:
        InputError: as :func:`load_checkpoint`, or the weights are not finite.
    """
    weights = load_checkpoint(path, "weights")
    by_name = isinstance(weights, dict) and all(
        isinstance(values, Tensor)
        and values.is_floating_point()
        and values.ndim >= 2
        and _is_whole(values)
        and bool(values.isfinite().all())
        for values in weights.values()
    )
    if not by_name or not weights:
        raise InputError(rejection("checkpoint", str(path), "finite weights by name"))
    return weights


def _is_whole(values: Tensor) -> bool:
    """Whether a number is stored for each element: a few bytes may claim to be a huge tensor."""
    if values.layout != torch.strided or values.device.type == "meta":
        return False
    return values.numel() * values.element_size() <= values.untyped_storage().nbytes()
