import os
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from hyuav._support.errors import InputError
from hyuav._support.files import open_regular, read_parquet, read_regular


def test_a_file_is_read_as_far_as_is_wanted(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.write_bytes(b"content")
    link.symlink_to(file)
    assert read_regular(link) == b"content"
    assert read_regular(file, 3) == b"con"
    assert read_regular(file, 10**30) == b"content"


def test_neither_a_pipe_nor_a_device_nor_a_directory_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "endless").symlink_to("/dev/zero")
    for path in (tmp_path / "pipe", tmp_path / "endless", tmp_path):
        with pytest.raises(OSError, match="not a file"):
            open_regular(path)


def test_a_file_larger_than_the_memory_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "holes").open("wb") as file:
        file.truncate(2**42)
    with pytest.raises(OSError, match="larger than the memory"):
        read_regular(tmp_path / "holes")


def test_a_table_is_read_whole_or_by_columns(tmp_path: Path) -> None:
    table, file = pd.DataFrame({"x": [1, 2], "y": [3, 4]}), tmp_path / "table.parquet"
    table.to_parquet(file)
    pd.testing.assert_frame_equal(read_parquet(file, "a table"), table)
    assert list(read_parquet(file, "a table", ["y"])) == ["y"]


@pytest.mark.parametrize("damage", ["none", "empty", "cut", "metadata", "column"])
def test_a_table_that_cannot_be_read_is_named(tmp_path: Path, damage: str) -> None:
    file = tmp_path / "table.parquet"
    if damage != "none":
        table = pa.table({"x": [1, 2]})
        if damage == "metadata":
            table = table.replace_schema_metadata({"pandas": "{}"})
        pq.write_table(table, file)
        kept = {"empty": 0, "cut": 50}.get(damage, file.stat().st_size)
        file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(InputError, match=r"table\.parquet: expected rates in Parquet \(.+\)$"):
        read_parquet(file, "rates", ["x", "y"] if damage == "column" else None)
