"""Recipes on a disk that is full: one line, and all that was there before stays."""

from pathlib import Path

import pytest

from faults import Disk, small_disk
from recipe_calls import TINY, TINY_COMPARISON, Call

EVALUATE = ["evaluate", "run=disk/run", "evaluation.episodes=4", "evaluation.resolution=10"]
COMPARE = ["compare", "algorithm=ddpg", "scenario=two_clusters", "scheme=relay", *TINY_COMPARISON]
COMPARE += ["learners=1", "output=disk/here"]


def contents(directory: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def halted(
    disk: Disk, call: Call, capsys: pytest.CaptureFixture[str], name: str, *arguments: str
) -> str:
    """The one line with which a recipe ends on a full disk, whose files it leaves as they were."""
    before = contents(disk.path)
    capsys.readouterr()
    with disk.full(), pytest.raises(SystemExit) as stopped:
        call(name, *arguments)
    assert stopped.value.code == 1
    assert contents(disk.path) == before
    (line,) = capsys.readouterr().err.splitlines()
    assert "No space left on device" in line or "File too large" in line
    return line


def test_an_earlier_evaluation_its_figures_and_its_report_stay(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_disk(tmp_path / "disk", megabytes=32) as disk:
        call("train", "hydra.run.dir=disk/run", "scenario.num_slots=5", *TINY)
        call(*EVALUATE)
        line = halted(disk, call, capsys, *EVALUATE)
        assert line.startswith("error: halted: disk/run/flights.parquet: ")
        assert line.endswith("; what was there before is kept, and the same command goes on")
        line = halted(disk, call, capsys, "draw", "run=disk/run", "figures=[animation]")
        assert line.startswith("error: halted: disk/run/figures/animation.gif: ")
        line = halted(disk, call, capsys, "report", "run=disk/run")
        assert line.startswith("error: halted: disk/run/report.html: ")
        call(*EVALUATE)


def test_a_comparison_begins_and_ends_when_there_is_room(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_disk(tmp_path / "disk", megabytes=64) as disk:
        line = halted(disk, call, capsys, *COMPARE)
        assert line.startswith(f"error: halted: {disk.path}/here/config.yaml: ")
        assert line.partition("; go on with: ")[2].endswith(" output=disk/here")
        call(*COMPARE)
        line = halted(disk, call, capsys, *COMPARE)
        assert line.startswith(f"error: halted: {disk.path}/here/results.parquet: ")
        call(*COMPARE)
