from pathlib import Path

import pytest

from hyuav._support.errors import InputError
from hyuav.experiments.metrics_file import MetricsFile
from hyuav.experiments.run_directory import METRIC_COLUMNS
from hyuav.viz.data.growing import GrowingMetrics

HEADER = ",".join(METRIC_COLUMNS) + "\n"


def line(episode: int, reward: float = 1.0) -> str:
    return f"{episode},{10 * episode},0,hybrid,0,10,{reward},,,,0.5\n"


def test_rows_appear_as_a_training_writes_them(tmp_path: Path) -> None:
    written = MetricsFile(tmp_path / "metrics.csv", METRIC_COLUMNS)
    growing = GrowingMetrics(tmp_path / "metrics.csv")
    assert growing.read().empty
    for episode in (1, 2):
        row = {"episode": episode, "slots": 10, "learner": 0, "scheme": "relay", "num_slots": 10}
        written.append([row | {"accumulated_reward": 2.5 * episode}])
        assert growing.read()["accumulated_reward"].tolist() == [2.5, 5.0][:episode]
    written.close()


def test_a_line_counts_once_it_ends(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(HEADER + line(1) + line(2)[:7])
    growing = GrowingMetrics(path)
    assert growing.read()["episode"].tolist() == [1]
    path.write_text(HEADER + line(1) + line(2))
    assert growing.read()["episode"].tolist() == [1, 2]


@pytest.mark.parametrize("later", [line(7), line(7, 3.0) * 5], ids=["shorter", "longer"])
def test_a_file_that_was_replaced_is_read_anew(tmp_path: Path, later: str) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(HEADER + line(1) + line(2))
    growing = GrowingMetrics(path)
    assert len(growing.read()) == 2
    path.write_text(HEADER + later)
    assert set(growing.read()["episode"]) == {7}
    assert len(growing.read()) == later.count("\n")


def test_damaged_lines_are_left_out_and_others_kept(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    damage = b'\xff\xfe,,"\n' + b"\0\0\0\n" + b"word,1,0,hybrid\n" + b"1," * 99 + b"\n"
    path.write_bytes(HEADER.encode() + line(1).encode() + damage + line(2, float("inf")).encode())
    rows = GrowingMetrics(path).read()
    assert rows["episode"].tolist() == [1, 2]
    assert rows["accumulated_reward"].isna().tolist() == [False, True]


def test_a_hundred_thousand_points_are_read(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(HEADER + "".join(line(episode) for episode in range(1, 100_001)))
    rows = GrowingMetrics(path).read()
    assert len(rows) == 100_000
    assert rows["slots"].iloc[-1] == 1_000_000


@pytest.mark.parametrize("content", ["a,b\n1,2\n", f"episode,{HEADER}", "\0\n"])
def test_the_table_of_another_program_is_refused_in_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=r"metrics\.csv header = .*: expected columns") as refused:
        GrowingMetrics(path).read()
    assert "\n" not in str(refused.value)


def test_a_file_that_is_gone_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        GrowingMetrics(tmp_path / "metrics.csv").read()
