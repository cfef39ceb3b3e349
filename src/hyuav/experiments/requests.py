"""What was asked for, kept in a directory so that only the same request goes on in it."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from hyuav._support.errors import InputError, rejection
from hyuav._support.files import create_durably, require_writable
from hyuav._support.yaml_files import read_yaml


def keep_request(
    directory: Path,
    request: Mapping[str, Any],
    working: tuple[str, ...],
    kind: str,
    unsaid: Mapping[str, Any] | None = None,
) -> None:
    """Write ``config.yaml``, or find the same request kept there.

    Args:
        directory: that was asked for as ``output``.
        request: the configuration.
        working: what the dotted names of entries begin with that change how the work is done and
            not what comes of it.
        kind: what the directory is to hold, such as "a comparison".
        unsaid: entries that a request that was kept earlier need not name, and what they were.

    Raises:
        InputError: another request is kept there, or it cannot be written to.
        OSError: the request cannot be kept, for want of space perhaps.
    """
    file = directory / "config.yaml"
    require_writable("output", directory)
    with contextlib.suppress(FileExistsError):
        create_durably(file, OmegaConf.to_yaml(dict(request)).encode())
        return
    try:
        asked, kept = _flat(request), _flat(unsaid or {}) | _flat(read_yaml(file))
    except InputError as error:
        accepted = f"{kind}'s directory (config.yaml: {error})"
        raise InputError(rejection("output", str(directory), accepted)) from None
    for name in (*asked, *kept):
        if not name.startswith(working) and asked.get(name) != kept.get(name):
            accepted = f"{kind} with {name} = {asked.get(name)} (there it is {kept.get(name)})"
            raise InputError(rejection("output", str(directory), accepted))


def _flat(config: Mapping[str, Any]) -> dict[str, Any]:
    """All entries by their dotted names."""
    flat: dict[str, Any] = {}
    for name, value in config.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": entry for key, entry in _flat(value).items()}
        else:
            flat[name] = value
    return flat
