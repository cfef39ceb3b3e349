"""State that is saved: written whole or not at all, read without running code, compared.

PyTorch and TorchRL accept much that fails only later, in the middle of an episode. So every entry
of a state is compared with an example before any is taken.
"""

import io
import zipfile
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import Field
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, brief, rejection
from hyuav._support.files import read_regular, write_durably
from hyuav._support.parameters import NonNegativeNumber, checked

FORMAT = "hyuav-checkpoint-2"

EARLIER_FORMATS = ("hyuav-checkpoint-1",)

BEGIN = ("step_count", "done", "terminated", "truncated")
"""Zero where a flight begins, as between two episodes."""

Check = Callable[[str, Any], None]
"""Accepts a value of a name, or raises InputError."""


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
    try:
        stored = _load(Path(path), device)
    except OSError as error:
        reason = error.strerror or type(error).__name__
    except Exception:  # what unpickling raises on a foreign file is up to its bytes
        reason = "not a checkpoint, truncated or damaged"
    else:
        if isinstance(stored, dict) and stored.get("format") in EARLIER_FORMATS:
            reason = "this one is of an earlier version and cannot be continued"
        elif not isinstance(stored, dict) or stored.get("format") != FORMAT:
            reason = "another program's"
        elif stored.get("kind") != kind:
            reason = f"this one is of kind {brief(stored.get('kind'))}"
        else:
            return stored.get("content")
    accepted = f"a checkpoint of kind {kind!r} written by hyuav ({reason})"
    raise InputError(rejection("checkpoint", str(path), accepted))


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


def require_entries(name: str, value: Any, expected: Collection[Any]) -> None:
    """Accept a dict of these keys.

    Raises:
        InputError: naming the first that is missing or too many.
    """
    if not isinstance(value, dict):
        raise InputTypeError(rejection(name, value, "names with values"))
    for key in expected:
        if key not in value:
            raise InputError(f"{name}: {brief(key)} is missing")
    for key in value:
        if key not in expected:
            raise InputError(f"{name}: unknown entry {brief(key)}")


def require_like(name: str, value: Any, example: Any) -> None:
    """Accept what is built as the example: tensors of its shapes and types, and all else equal.

    Args:
        name: of the value, for errors.
        value: to compare.
        example: may hold checks, of a name and a value, in place of values.

    Raises:
        InputError: naming the entry.
    """
    if isinstance(example, Tensor):
        _require_tensor(name, value, example)
    elif isinstance(example, Mapping):
        require_entries(name, value, example)
        for key, own in example.items():
            require_like(f"{name}.{key}", value[key], own)
    elif callable(example):
        example(name, value)
    elif type(value) is not type(example):
        raise InputTypeError(rejection(name, value, brief(example)))
    elif isinstance(example, list | tuple):
        if len(value) != len(example):
            raise InputError(f"{name}: expected a list of {len(example)}")
        for index, (given, own) in enumerate(zip(value, example, strict=True)):
            require_like(f"{name}[{index}]", given, own)
    elif value != example:
        raise InputError(rejection(name, value, brief(example)))


def _require_tensor(name: str, value: Any, example: Tensor) -> None:
    accepted = f"{example.dtype} of shape {tuple(example.shape)}"
    if not isinstance(value, Tensor):
        raise InputTypeError(rejection(name, value, accepted))
    plain = value.layout == torch.strided and value.device.type != "meta"
    alike = value.dtype == example.dtype and value.shape == example.shape
    if not (plain and alike) or value.requires_grad:
        found = f"{value.dtype} of shape {tuple(value.shape)}"
        raise InputError(f"{name} is {found}: expected a plain tensor, {accepted}")


def _checked(example: Tensor, holds: Callable[[Tensor], Tensor], accepted: str) -> Check:
    """A check for a tensor like the example all of whose elements are accepted."""

    def check(name: str, value: Any) -> None:
        require_like(name, value, example)
        if not holds(value).all():
            raise InputError(f"{name}: expected {accepted}")

    return check


def counted_to(most: int) -> Check:
    """A check for a whole number from 0 to ``most``."""
    accepted = Annotated[int, Field(ge=0, le=most)]
    return lambda name, value: checked(accepted, name, value)


counted = counted_to(2**53)
"""A check for how many episodes, updates or draws there were: all float64 can tell apart."""


def finite_like(example: Tensor) -> Check:
    """A check for a tensor like the example, of finite numbers."""
    return _checked(example, torch.isfinite, "finite numbers")


def below_infinity(example: Tensor) -> Check:
    """A check for a tensor like the example, of finite numbers or minus infinity."""
    return _checked(example, lambda value: value < torch.inf, "finite numbers, or minus infinity")


def zeros_like(example: Tensor) -> Check:
    """A check for a tensor like the example, of zeros."""
    return _checked(example, lambda value: value == 0, "zeros, since a flight begins")


def begins_episode(observed: Mapping[str, Any]) -> dict[str, Any]:
    """An example of what helpers observe where a flight begins, from what they observe."""
    checks = {True: zeros_like, False: finite_like}
    return {
        name: checks[name in BEGIN](own) if name in BEGIN or own.is_floating_point() else own
        for name, own in observed.items()
    }


def draws_like(stream: Mapping[str, Any]) -> dict[str, Any]:
    """An example of where random numbers stand: their keys, and how many have been drawn."""
    return {key: own if isinstance(own, Tensor) else counted for key, own in stream.items()}


def optimizer_like(optimizer: Mapping[str, Any]) -> dict[str, Any]:
    """An example of the state of Adam, from the state of one on the same weights."""

    def require_step(name: str, value: Any) -> None:
        require_like(name, value, torch.zeros((), dtype=torch.float32, device="cpu"))
        checked(NonNegativeNumber, name, value)

    moments = {index: {**own, "step": require_step} for index, own in optimizer["state"].items()}
    return {**optimizer, "state": moments}


def copied(value: Any) -> Any:
    """A copy in which no two numbers share memory, in dicts, lists and tuples; it is written to."""
    if isinstance(value, Tensor):
        return value.clone()
    if isinstance(value, dict):
        return {key: copied(own) for key, own in value.items()}
    if isinstance(value, list):
        return [copied(own) for own in value]
    return value
