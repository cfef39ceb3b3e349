import os
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from faults import small_disk
from hyuav._support.errors import InputError
from hyuav.learning.checkpoint import load_checkpoint, load_weights_file, save_checkpoint


def test_a_checkpoint_holds_tensors_and_plain_values(tmp_path: Path) -> None:
    content: dict[str, Any] = {
        "weights": torch.randn(3, 2),
        "slots": 7,
        "nested": {"list": [1.5, "a", True, None]},
    }
    save_checkpoint(tmp_path / "deep" / "last.pt", "training", content)
    loaded = load_checkpoint(tmp_path / "deep" / "last.pt", "training")
    assert torch.equal(loaded.pop("weights"), content.pop("weights"))
    assert loaded == content


@pytest.mark.parametrize("fault", ["full", "read_only"])
def test_a_disk_that_refuses_leaves_the_last_checkpoints(tmp_path: Path, fault: str) -> None:
    with small_disk(tmp_path / "disk") as disk:
        file, before = disk.path / "last.pt", disk.path / "previous.pt"
        for slots in (1, 2):
            save_checkpoint(file, "training", {"slots": slots}, keep=before)
        with getattr(disk, fault)(), pytest.raises(OSError, match=r"last\.pt"):
            save_checkpoint(file, "training", {"weights": torch.zeros(10_000)}, keep=before)
        assert load_checkpoint(file, "training") == {"slots": 2}
        assert load_checkpoint(before, "training") == {"slots": 1}
        assert {path.name for path in disk.path.iterdir()} == {"last.pt", "previous.pt"}


def test_the_checkpoint_before_is_kept_where_that_is_wanted(tmp_path: Path) -> None:
    file, before = tmp_path / "last.pt", tmp_path / "previous.pt"
    for slots in (1, 2, 3):
        save_checkpoint(file, "training", {"slots": slots}, keep=before)
    assert load_checkpoint(file, "training") == {"slots": 3}
    assert load_checkpoint(before, "training") == {"slots": 2}


@pytest.mark.parametrize("place", [0.3, 0.5, 0.7])
def test_a_checkpoint_in_which_one_bit_is_wrong_is_refused(tmp_path: Path, place: float) -> None:
    file = tmp_path / "last.pt"
    save_checkpoint(file, "training", {"weights": torch.randn(100, 100)})
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= 1
    file.write_bytes(content)
    refusal(file)


def refusal(path: Path, kind: str = "training") -> str:
    with pytest.raises(InputError) as caught:
        load_checkpoint(path, kind)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith("checkpoint = ")
    assert "expected a checkpoint of kind" in line
    return line


def test_a_missing_checkpoint_is_named(tmp_path: Path) -> None:
    assert "No such file" in refusal(tmp_path / "none.pt")


def test_a_directory_is_not_a_checkpoint(tmp_path: Path) -> None:
    refusal(tmp_path)


def test_neither_a_pipe_nor_a_device_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "endless").symlink_to("/dev/zero")
    for path in (tmp_path / "pipe", tmp_path / "endless"):
        assert "not a file" in refusal(path)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_checkpoint_is_refused(tmp_path: Path, share: float) -> None:
    file = tmp_path / "last.pt"
    save_checkpoint(file, "training", {"weights": torch.randn(100, 100)})
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    refusal(file)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x80\x04N.", bytes(range(256))])
def test_another_file_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "foreign.pt"
    file.write_bytes(content)
    refusal(file)


def test_another_programs_checkpoint_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "foreign.pt"
    torch.save({"state_dict": {"weight": torch.zeros(3)}}, file)
    assert "another program" in refusal(file)


def test_a_checkpoint_of_an_earlier_version_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "last.pt"
    torch.save({"format": "hyuav-checkpoint-1", "kind": "training", "content": {}}, file)
    assert "of an earlier version and cannot be continued" in refusal(file)


def test_a_checkpoint_of_another_kind_is_refused(tmp_path: Path) -> None:
    save_checkpoint(tmp_path / "best.pt", "weights", {})
    assert "'weights'" in refusal(tmp_path / "best.pt", "training")


class _Command:
    """Unpickling this runs a command."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.marker),)


def test_loading_runs_no_code_from_a_checkpoint(tmp_path: Path) -> None:
    marker = tmp_path / "was-here"
    torch.save(_Command(marker), tmp_path / "hostile.pt")
    refusal(tmp_path / "hostile.pt")
    assert not marker.exists()


@given(st.binary(max_size=300), st.sampled_from([b"", b"\x80\x02", b"PK\x03\x04", b"\x80\x04}q"]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_bytes_end_in_a_traceback(tmp_path: Path, content: bytes, prefix: bytes) -> None:
    file = tmp_path / "foreign.pt"
    file.write_bytes(prefix + content)
    refusal(file)


@pytest.mark.parametrize(
    "content", [3, [torch.zeros(2)], {"weight": 3}, {"weight": torch.tensor([1.0, torch.nan])}]
)
def test_what_is_not_finite_weights_is_refused(tmp_path: Path, content: Any) -> None:
    save_checkpoint(tmp_path / "best.pt", "weights", content)
    with pytest.raises(InputError, match=r"^checkpoint = .*: expected finite weights by name$"):
        load_weights_file(tmp_path / "best.pt")
