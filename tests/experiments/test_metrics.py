import os
from pathlib import Path

import pandas as pd
import pytest

from hyuav._support.errors import InputError
from hyuav.experiments.metrics import (
    METRIC_COLUMNS,
    GrowingMetrics,
    MetricsFile,
    finite_numbers,
    parse_rows,
    read_metrics,
    readable_metrics,
)

COLUMNS = ["episode", "learner", "scheme", "evaluation"]


@pytest.mark.parametrize("value", ["1" * 400, "inf", "-inf", "1e999", "nan", "x", "0x10", ""])
def test_what_is_no_finite_number_in_metrics_is_none(value: str) -> None:
    assert finite_numbers(pd.Series([value, "2"])).isna().tolist() == [True, False]


def test_a_whole_number_of_hundreds_of_digits_leaves_the_others() -> None:
    assert finite_numbers(pd.Series([10**400, 3])).fillna(-1.0).tolist() == [-1.0, 3.0]


def test_whole_rows_are_read_and_damaged_ones_left_out() -> None:
    lines = (
        b"1,0,hybrid,2.5\n2,0,hybrid\n3,0,hybrid,4,5\n,0,hybrid,1\n4,1,relay,\n5,0,hy\0brid,inf\n"
    )
    rows = parse_rows(lines, COLUMNS)
    assert rows["episode"].tolist() == [1.0, 4.0, 5.0]
    assert rows["scheme"].tolist() == ["hybrid", "relay", "hybrid"]
    assert rows["evaluation"].isna().tolist() == [False, True, True]


def test_metrics_can_be_read_while_they_are_written(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    file = MetricsFile(path, METRIC_COLUMNS)
    file.append([{"episode": 1, "scheme": "relay"}])
    file.append([{"episode": 2, "scheme": "relay", "evaluation": 3.5}])
    table = read_metrics(path)
    assert table["episode"].tolist() == [1, 2]
    assert table["evaluation"].isna().tolist() == [True, False]
    file.close()


@pytest.mark.parametrize(
    "content",
    [
        *(b"", bytes(range(256)) * 20, b"a,b\n1,2\n"),
        (",".join(METRIC_COLUMNS) + "\n1,20,0,best,3,20,1.5,,,,0.1\n").encode(),
        (",".join(METRIC_COLUMNS) + "\n1,20,0,relay,3,20,high,,,,0.1\n").encode(),
        (",".join(METRIC_COLUMNS) + "\n1,20,0,relay,3,20,True,,,,0.1\n").encode(),
    ],
)
def test_metrics_that_no_training_wrote_are_refused_in_one_line(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "metrics.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"^metrics = '[^\n]*: expected the table [^\n]*$"):
        read_metrics(path)


def test_metrics_are_read_from_files_only(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.csv"
    os.mkfifo(metrics)
    with pytest.raises(InputError, match="not a file"):
        read_metrics(metrics)
    assert readable_metrics(metrics).empty
    metrics.unlink()
    metrics.mkdir()
    with pytest.raises(InputError, match="not a file"):
        read_metrics(metrics)


HEADER = ",".join((*METRIC_COLUMNS, "loss_critic"))
ROW = "{episode},20,0,hybrid,3,20,1.5,,,,0.1,0.25"


def _write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_metrics_are_read_as_they_were_written(tmp_path: Path) -> None:
    rows = "".join(f"{ROW.format(episode=episode)}\n" for episode in (1, 2))
    metrics = readable_metrics(_write(tmp_path / "metrics.csv", f"{HEADER}\n{rows}"))
    assert metrics["episode"].tolist() == [1, 2]
    assert metrics["scheme"].tolist() == ["hybrid"] * 2
    assert metrics["loss_critic"].tolist() == [0.25] * 2
    assert metrics["evaluation"].isna().all()


@pytest.mark.parametrize("cut", range(1, len(ROW.format(episode=12)) + 1, 3))
def test_a_row_that_is_being_written_is_left_out(cut: int, tmp_path: Path) -> None:
    whole = f"{HEADER}\n{ROW.format(episode=11)}\n"
    path = _write(tmp_path / "metrics.csv", whole + ROW.format(episode=12)[:cut])
    assert readable_metrics(path)["episode"].tolist() == [11]


@pytest.mark.parametrize("text", ["", "epis", HEADER, f"{HEADER}\n", "\n\n", "\0\0\n"])
def test_metrics_without_a_whole_row_are_empty(text: str, tmp_path: Path) -> None:
    metrics = readable_metrics(_write(tmp_path / "metrics.csv", text))
    assert len(metrics) == 0
    assert set(METRIC_COLUMNS) <= set(metrics.columns)


def test_metrics_that_are_missing_are_empty(tmp_path: Path) -> None:
    assert len(readable_metrics(tmp_path / "none.csv")) == 0


def test_damaged_rows_are_left_out(tmp_path: Path) -> None:
    good = ROW.format(episode=1)
    lines = [HEADER, good, "what is this", f"{good},7,8,9", '"\xff,3', good.replace("1", "x", 1)]
    path = tmp_path / "metrics.csv"
    path.write_bytes("\n".join([*lines, ""]).encode("latin-1"))
    assert readable_metrics(path)["episode"].tolist() == [1]


NO_LOSSES = ",".join(METRIC_COLUMNS) + "\n"


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
    path.write_text(NO_LOSSES + line(1) + line(2)[:7])
    growing = GrowingMetrics(path)
    assert growing.read()["episode"].tolist() == [1]
    path.write_text(NO_LOSSES + line(1) + line(2))
    assert growing.read()["episode"].tolist() == [1, 2]


@pytest.mark.parametrize("later", [line(7), line(7, 3.0) * 5], ids=["shorter", "longer"])
def test_a_file_that_was_replaced_is_read_anew(tmp_path: Path, later: str) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(NO_LOSSES + line(1) + line(2))
    growing = GrowingMetrics(path)
    assert len(growing.read()) == 2
    path.write_text(NO_LOSSES + later)
    assert set(growing.read()["episode"]) == {7}
    assert len(growing.read()) == later.count("\n")


def test_damaged_lines_are_left_out_and_others_kept(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    damage = b'\xff\xfe,,"\n' + b"\0\0\0\n" + b"word,1,0,hybrid\n" + b"1," * 99 + b"\n"
    path.write_bytes(
        NO_LOSSES.encode() + line(1).encode() + damage + line(2, float("inf")).encode()
    )
    rows = GrowingMetrics(path).read()
    assert rows["episode"].tolist() == [1, 2]
    assert rows["accumulated_reward"].isna().tolist() == [False, True]


def test_a_hundred_thousand_points_are_read(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(NO_LOSSES + "".join(line(episode) for episode in range(1, 100_001)))
    rows = GrowingMetrics(path).read()
    assert len(rows) == 100_000
    assert rows["slots"].iloc[-1] == 1_000_000


@pytest.mark.parametrize("content", ["a,b\n1,2\n", f"episode,{NO_LOSSES}", "\0\n"])
def test_the_table_of_another_program_is_refused_in_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / "metrics.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=r"metrics\.csv header = .*: expected columns") as refused:
        GrowingMetrics(path).read()
    assert "\n" not in str(refused.value)


def test_a_file_that_is_gone_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        GrowingMetrics(tmp_path / "metrics.csv").read()
