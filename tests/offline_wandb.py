"""Read back what an offline run of Weights & Biases recorded, in LevelDB's log format."""

import json
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wandb.proto import wandb_internal_pb2

BLOCK, HEADER = 32768, struct.Struct("<IHB")
FULL, FIRST, MIDDLE, LAST = 1, 2, 3, 4


def records_of(content: bytes) -> Iterator[bytes]:
    position, parts = 7, b""  # the file's own header comes first
    while position + HEADER.size <= len(content):
        left_in_block = BLOCK - position % BLOCK
        if left_in_block < HEADER.size:
            position += left_in_block
            continue
        _, length, kind = HEADER.unpack_from(content, position)
        start = position + HEADER.size
        if start + length > len(content):
            return  # the rest of this one is still being written
        piece = content[start : start + length]
        position = start + length
        parts = piece if kind in (FULL, FIRST) else parts + piece
        if kind in (FULL, LAST):
            yield parts


def offline_runs(directory: Path) -> list[Path]:
    """The records of the finished offline runs below ``directory``, the oldest first.

    The service of Weights & Biases may write the last of them after the run has been left.
    """
    files = directory.glob("wandb/offline-run-*/*.wandb")
    begun = sorted(files, key=lambda file: file.parent.stat().st_ctime_ns)
    deadline = time.monotonic() + 60.0
    while not all(recorded(file, "exit") for file in begun):
        assert time.monotonic() < deadline, "a run never ended"
        time.sleep(0.05)
    return begun


def recorded(file: Path, kind: str) -> list[Any]:
    """All records of one kind in a run's file: "run", "metric", "artifact", "exit" and others."""
    found = []
    for data in records_of(file.read_bytes()):
        record = wandb_internal_pb2.Record()  # type: ignore[attr-defined]
        record.ParseFromString(data)
        if record.WhichOneof("record_type") == kind:
            found.append(getattr(record, kind))
    return found


def history(file: Path) -> list[dict[str, Any]]:
    """What a run logged, a record per step."""
    return [
        {"/".join(item.nested_key) or item.key: json.loads(item.value_json) for item in each.item}
        for each in recorded(file, "history")
    ]


def summary(file: Path) -> dict[str, Any]:
    """What a run's summary came to, by dotted names."""
    return {
        ".".join(item.nested_key) or item.key: json.loads(item.value_json)
        for each in recorded(file, "summary")
        for item in each.update
    }


def logged_history(directory: Path) -> list[dict[str, Any]]:
    """The history of the one offline run below ``directory``, a record per step."""
    (file,) = offline_runs(directory)
    return history(file)
