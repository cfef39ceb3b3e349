import io

from rich.console import Console

from hyuav.terminal import results_table


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
