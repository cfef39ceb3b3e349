"""Reading the lines of a ``metrics.csv``, some of which may be damaged."""

import csv
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

IDENTITY = ("episode", "learner", "scheme")
"""Columns without which a row says nothing."""


def parse_rows(lines: bytes, columns: Sequence[str]) -> pd.DataFrame:
    """Rows from whole lines: numbers, but for ``scheme``; what is no finite number is NaN.

    A line that has not a value or nothing for each column, or that lacks its :data:`IDENTITY`, is
    left out.

    Args:
        lines: each with its end of line.
        columns: of the table, :data:`IDENTITY` among them.
    """
    whole = [
        line
        for line in lines.replace(b"\0", b"").splitlines()
        if line.count(b",") == len(columns) - 1
    ]
    rows = pd.read_csv(
        io.BytesIO(b"\n".join([",".join(columns).encode(), *whole])),
        index_col=False,
        encoding_errors="replace",
        quoting=csv.QUOTE_NONE,
        dtype={"scheme": str},
        low_memory=False,
    )
    for name in rows.columns.drop("scheme"):
        rows[name] = finite_numbers(rows[name])
    return rows.dropna(subset=list(IDENTITY)).reset_index(drop=True)


def finite_numbers(column: "pd.Series[Any]") -> "pd.Series[float]":
    """A column as float64, in which whatever is no finite number is NaN."""
    try:
        numbers = pd.to_numeric(column, errors="coerce").astype("float64")
    except OverflowError:  # a whole number of hundreds of digits
        written = column.astype(str)
        numbers = pd.to_numeric(written.where(written.str.len() < 300), errors="coerce")
        numbers = numbers.astype("float64")
    return numbers.where(np.isfinite(numbers))
