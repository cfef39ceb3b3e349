"""Tables for the terminal, in one style."""

from rich import box
from rich.table import Table


def results_table(title: str, first: str, *headings: str) -> Table:
    """A table without rows that wastes no columns.

    Args:
        title: above it.
        first: heading of the first column, which names the rows.
        headings: of the columns of numbers.
    """
    table = Table(
        title=title,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    table.add_column(first, no_wrap=True)
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table
