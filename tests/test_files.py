import os
from pathlib import Path

import pytest

from hyuav.files import open_regular, read_regular


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
