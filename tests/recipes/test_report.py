"""The recipe that writes reports, as a user calls it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from hyuav.experiments.run_directory import RunDirectory
from recipe_calls import Call, Refusal

pytest_plugins = "sample_runs"

Copy = Callable[[RunDirectory], RunDirectory]
Printed = pytest.CaptureFixture[str]


def test_reports_of_several_directories_are_written_anew(
    call: Call, evaluated: RunDirectory, copied: Copy, tmp_path: Path, capsys: Printed
) -> None:
    run, nothing = copied(evaluated).path, tmp_path / "nothing"
    nothing.mkdir()
    (run / "report.html").write_text("old")
    call("report", f"run=[{run},{nothing}]")
    told = capsys.readouterr().out.split()
    assert told == ["report:", f"{run}/report.html", "report:", f"{nothing}/report.html"]
    assert "Learning curves" in (run / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "error: run is missing: expected run=DIRECTORY, or run=[DIRECTORY,...]"),
        (["run=none"], "error: run = 'none': expected an existing directory"),
    ],
)
def test_a_mistake_is_told_in_one_line(arguments: list[str], line: str, refusal: Refusal) -> None:
    assert refusal("report", *arguments) == f"{line}\n"
