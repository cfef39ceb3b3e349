"""Which run of Weights & Biases a directory belongs to."""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hyuav._support.errors import harmless
from hyuav._support.files import read_regular, write_durably
from hyuav._support.parameters import checked
from hyuav.experiments.tracking.parameters import Identifier, LoggerParameters

MEMORY_FILE = "wandb.json"
"""In a run directory, which W&B run it belongs to."""

IDENTITY = ("id", "mode", "project", "entity", "group")
"""What it says of that run."""

LARGEST_MEMORY = 2**16
"""Bytes of it that are read."""


def remember(directory: Path, identity: Mapping[str, Any]) -> None:
    """Write down which run a directory belongs to.

    Args:
        directory: of the job.
        identity: by the names of ``IDENTITY``.

    Raises:
        OSError: it cannot be written.
    """
    content = f"{json.dumps({name: identity[name] for name in IDENTITY}, indent=2)}\n"
    write_durably(directory / MEMORY_FILE, content.encode())


def remembered(directory: Path) -> dict[str, Any]:
    """Which W&B run a directory belongs to: id, mode, project, entity and group; empty if none.

    Where the file is not one that a run wrote, that is told on the standard error, and none is
    known.
    """
    file = directory / MEMORY_FILE
    try:
        content = json.loads(read_regular(file, LARGEST_MEMORY).decode())
        identity = {name: content[name] for name in IDENTITY}
        checked(Identifier, "id", identity["id"])
        LoggerParameters.from_dict(identity)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        line = "is damaged: the run that it was for is not known, and cannot be continued"
        print(harmless(f"W&B: {file} {line}"), file=sys.stderr)
        return {}
    return identity


def model_name(run_id: str) -> str:
    """The artifact that holds a run's checkpoints."""
    return f"model-{run_id}"
