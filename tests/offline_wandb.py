"""Read back what an offline run of Weights & Biases recorded, in LevelDB's log format."""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wandb.proto import wandb_internal_pb2

BLOCK, HEADER = 32768, struct.Struct("<IHB")
FULL, FIRST, MIDDLE, LAST = 1, 2, 3, 4


def _records(content: bytes) -> Iterator[bytes]:
    position, parts = 7, b""  # the file's own header comes first
    while position + HEADER.size <= len(content):
        left_in_block = BLOCK - position % BLOCK
        if left_in_block < HEADER.size:
            position += left_in_block
            continue
        _, length, kind = HEADER.unpack_from(content, position)
        start = position + HEADER.size
        piece = content[start : start + length]
        position = start + length
        parts = piece if kind in (FULL, FIRST) else parts + piece
        if kind in (FULL, LAST):
            yield parts


def logged_history(directory: Path) -> list[dict[str, Any]]:
    """The history of the one offline run below ``directory``, a record per step."""
    (file,) = directory.glob("wandb/offline-run-*/*.wandb")
    history = []
    for data in _records(file.read_bytes()):
        record = wandb_internal_pb2.Record()  # type: ignore[attr-defined]
        record.ParseFromString(data)
        if record.WhichOneof("record_type") == "history":
            items = record.history.item
            history.append(
                {
                    "/".join(item.nested_key) or item.key: json.loads(item.value_json)
                    for item in items
                }
            )
    return history
