"""Figures of a finished run, drawn again as a user asks for them."""

import os
from pathlib import Path

import pytest

from recipe_calls import FEW, SHORT, Call, Refusal


def test_figures_are_drawn_from_a_finished_run(
    call: Call, once: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    call("draw", "run=run", "figures=sum_rate_maps")
    figures = tmp_path / "run" / "figures"
    assert {path.name for path in figures.iterdir()} == {
        f"sum_rate_maps.{suffix}" for suffix in ("pdf", "png", "csv")
    }
    call("draw", "run=run")
    assert (figures / "learning_curves.pdf").exists()
    printed = capsys.readouterr().out
    assert "run: figure animation is left out: there is no flights.parquet" in printed
    assert printed.endswith("figures: run/figures\n")


@pytest.mark.parametrize("name", ["evaluation.json", "flights.parquet"])
def test_a_directory_where_a_result_belongs_is_answered_by_one_line(
    once: Call, refusal: Refusal, tmp_path: Path, name: str
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    once("evaluate", "run=run", *FEW)
    (tmp_path / "run" / name).unlink()
    (tmp_path / "run" / name).mkdir()
    line = f"{name} = 'run/{name}': expected a file or none, not a directory"
    assert line in refusal("evaluate", "run=run")
    assert f"run/{name}: expected " in refusal("draw", "run=run", "figures=[animation]")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "run is missing: expected run=DIRECTORY"),
        (["run=nowhere"], "run = 'nowhere': expected a run directory"),
        (["run=run", "figures=fig2"], "figures = 'fig2': expected one of learning_curves, "),
        (["run=run", "figures=[energy]"], "figure energy: there is no evaluation.json in run"),
    ],
)
def test_a_mistake_is_answered_by_one_line(
    once: Call, refusal: Refusal, tmp_path: Path, arguments: list[str], line: str
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    assert line in refusal("draw", *arguments)
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("damage", ["noise", "a directory", "a pipe"])
def test_damaged_metrics_leave_a_figure_out_and_refuse_it_where_it_is_asked_for(
    call: Call,
    once: Call,
    refusal: Refusal,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    damage: str,
) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    metrics = tmp_path / "run" / "metrics.csv"
    metrics.unlink()
    if damage == "noise":
        metrics.write_bytes(bytes(range(256)) * 20)
    elif damage == "a pipe":
        os.mkfifo(metrics)
    else:
        metrics.mkdir()
    line = "figure learning_curves: metrics = 'run/metrics.csv': expected the table"
    assert line in refusal("draw", "run=run", "figures=learning_curves")
    capsys.readouterr()
    call("draw", "run=run")
    assert "figure learning_curves is left out: metrics = " in capsys.readouterr().out


def test_a_pipe_is_not_waited_for(once: Call, refusal: Refusal, tmp_path: Path) -> None:
    once("train", "hydra.run.dir=run", *SHORT)
    os.mkfifo(tmp_path / "run" / "evaluation.json")
    line = "figure energy: run/evaluation.json: expected an evaluation in JSON"
    assert line in refusal("draw", "run=run", "figures=energy")
