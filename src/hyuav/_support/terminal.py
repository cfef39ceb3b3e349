"""Tables and progress for the terminal, in one style; piped, they are plain and quiet."""

from collections.abc import Sequence
from typing import Any, Self

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.padding import Padding
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from hyuav._support.errors import harmless

WIDE = 80
"""Columns from which on a line of progress has room for everything."""

RETURNS_SHOWN = 3
"""Learners whose return is shown; of more, the mean."""


class LiteralTable(Table):
    """A table that shows what its rows hold as it is, not as markup."""

    def add_row(self, *cells: object, **options: Any) -> None:
        """Add a row of texts or numbers."""
        super().add_row(*(_literal(str(cell)) for cell in cells), **options)


def results_table(title: str, first: str, *headings: str) -> LiteralTable:
    """A table without rows that wastes no columns, and takes nothing for markup.

    Args:
        title: above it.
        first: heading of the first column, which names the rows.
        headings: of the columns of numbers.
    """
    table = LiteralTable(
        title=_literal(title, "table.title"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column(_literal(first), no_wrap=True)
    for heading in headings:
        table.add_column(_literal(heading), justify="right", no_wrap=True)
    return table


def _literal(text: str, style: str = "") -> Text:
    """Text that may have several lines."""
    return Text("\n".join(map(harmless, text.split("\n"))), style)


def print_line(text: str, console: Console) -> None:
    """Print a line as it is, which may name what others named: nothing in it is obeyed.

    Args:
        text: of the line.
        console: to print on. A line that is too long for it is left to the terminal to wrap.
    """
    console.print(Text(harmless(text)), soft_wrap=True)


def print_table(table: Table, console: Console) -> None:
    """Print a table whole, however narrow the terminal is.

    Where its columns do not fit, each row becomes a few lines, a heading and a value in each.
    Piped, the table has its own width.

    Args:
        table: as :func:`results_table` makes it.
        console: to print on.
    """
    options = console.options.update(max_width=10_000)
    width = Measurement.get(console, options, table).maximum
    if width <= console.width:
        console.print(table)
    elif not console.is_terminal:
        Console(file=console.file, width=width).print(table)
    else:
        _print_rows(table, console)


def _print_rows(table: Table, console: Console) -> None:
    console.print(table.title, style="italic", highlight=False)
    # In one line, without the hyphens before its breaks.
    headings = [" ".join(str(own.header).replace("-\n", "").split()) for own in table.columns]
    for name, *cells in zip(*(column.cells for column in table.columns), strict=True):
        console.print(Text(str(name), style="bold"))
        for heading, cell in zip(headings[1:], cells, strict=True):
            text = Text(f"{heading}: {cell}")
            console.print(Padding(text, (0, 0, 0, 2), expand=False), highlight=False)
    if table.caption:
        console.print(table.caption, style="italic", highlight=False)


def make_progress(console: Console, description: str, *facts: ProgressColumn) -> Progress:
    """Progress with the time left; it is shown on terminals that can redraw a line.

    Args:
        console: to show it on. A narrow one gets neither a bar nor the time spent.
        description: format of the task's name.
        facts: columns besides.
    """
    wide = console.width >= WIDE
    columns: list[ProgressColumn] = [
        TextColumn(description),
        *([BarColumn(bar_width=20)] if wide else []),
        MofNCompleteColumn(),
        *facts,
        *([TimeElapsedColumn()] if wide else []),
        TimeRemainingColumn(),
        TextColumn("left"),
    ]
    return Progress(*columns, console=console, disable=not console.is_interactive)


class TrainingProgress:
    """How far a training is and what it returns; use it as a context manager.

    Args:
        console: to show it on.
        episodes: of the training.
        flown: before it began.
        unit: of what it returns.
    """

    def __init__(
        self, console: Console, episodes: int, flown: int = 0, unit: str = "bps/Hz"
    ) -> None:
        # Columns are formats: whatever a unit holds is shown as it is.
        told = f"{{task.fields[returns]}} {unit.replace('{', '{{').replace('}', '}}')}".rstrip()
        self._progress = make_progress(console, "training", TextColumn(told, markup=False))
        self._task = self._progress.add_task(
            "training", total=episodes, completed=flown, returns="-"
        )

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def update(self, episode: int, returns: Sequence[float]) -> None:
        """Show the episode and what it returned to each learner."""
        shown = " ".join(f"{value:.1f}" for value in returns)
        if len(returns) > RETURNS_SHOWN:
            shown = f"mean {sum(returns) / len(returns):.1f}"
        self._progress.update(self._task, completed=episode, returns=shown)
