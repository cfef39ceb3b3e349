import io
import re

import pytest
from rich.console import Console

from hyuav._support.terminal import TrainingProgress, print_line, print_table, results_table


def test_rows_are_named_on_the_left_and_numbers_aligned_on_the_right() -> None:
    table = results_table("A title", "Name", "steps/s", "share")
    table.add_row("one", "5", "10 %")
    table.add_row("another", "1,234", "9 %")
    console = Console(file=io.StringIO(), width=80)
    console.print(table)
    assert isinstance(console.file, io.StringIO)
    title, _, heading, _, first, second, *_ = console.file.getvalue().splitlines()
    assert title.startswith("A title")
    assert heading.split() == ["Name", "steps/s", "share"]
    assert first.strip().startswith("one")
    assert first.index("5") == second.index("1,234") + 4


def printed(width: int, *, terminal: bool) -> str:
    table = results_table("A title", "Scheme", "Secrecy\nsum-rate", "off-\nloading")
    table.add_row("Proposed", "58.27 [58.11, 58.43]", "79.0 %")
    console = Console(file=io.StringIO(), width=width, force_terminal=terminal, color_system=None)
    print_table(table, console)
    assert isinstance(console.file, io.StringIO)
    return re.sub(r"\x1b\[\d*m", "", console.file.getvalue())


def test_a_table_too_wide_for_the_terminal_becomes_lines_that_lose_nothing() -> None:
    assert [line.rstrip() for line in printed(20, terminal=True).splitlines()[2:]] == [
        "  Secrecy sum-rate:",
        "  58.27 [58.11,",
        "  58.43]",
        "  offloading: 79.0 %",
    ]


def test_a_table_that_is_piped_is_never_cut() -> None:
    narrow, wide = printed(20, terminal=False), printed(200, terminal=False)
    assert [line.rstrip() for line in narrow.splitlines()] == [
        line.rstrip() for line in wide.splitlines()
    ]


HOSTILE = "[/][red]a  b\x1b[2J\x1b]0;c\x07\u202e"
SHOWN = "[/][red]a  b?[2J?]0;c??"


@pytest.mark.parametrize("width", [20, 200])
@pytest.mark.parametrize("terminal", [True, False])
def test_names_of_others_are_text_that_no_terminal_obeys(width: int, *, terminal: bool) -> None:
    console = Console(file=io.StringIO(), width=width, force_terminal=terminal, color_system=None)
    table = results_table(HOSTILE, HOSTILE, HOSTILE)
    table.add_row(HOSTILE, HOSTILE)
    print_table(table, console)
    print_line(HOSTILE, console)
    assert isinstance(console.file, io.StringIO)
    shown = re.sub(r"\x1b\[\d*m", "", console.file.getvalue())
    assert shown.endswith(f"{SHOWN}\n")
    assert all(line.isprintable() for line in shown.splitlines())
    if width == 200:
        assert shown.count(SHOWN) == 6


@pytest.mark.parametrize("width", [60, 80, 120])
def test_progress_with_the_time_left_fits_its_line(width: int) -> None:
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    with TrainingProgress(console, 1000, 900) as progress:
        progress.update(1000, [57.1, 43.0, 55.9, 1.0])
    assert isinstance(console.file, io.StringIO)
    last = re.split(r"[\r\n]", re.sub(r"\x1b\[[\d?]*\w", "", console.file.getvalue()).strip())[-1]
    assert len(last) <= width
    assert "1000/1000" in last
    assert "mean 39.2 bps/Hz" in last
    assert last.rstrip().endswith("0:00:00 left")


def test_progress_is_silent_where_no_line_can_be_redrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    for terminal in (False, True):
        console = Console(file=io.StringIO(), force_terminal=terminal)
        with TrainingProgress(console, 10) as progress:
            progress.update(10, [1.0])
        assert isinstance(console.file, io.StringIO)
        assert console.file.getvalue() == ""
