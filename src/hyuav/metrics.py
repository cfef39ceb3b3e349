"""Reading the lines of a ``metrics.csv``, some of which may be damaged."""

import csv
import io
from collections.abc import Sequence

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
        numbers = pd.to_numeric(rows[name], errors="coerce").astype("float64")
        rows[name] = numbers.where(np.isfinite(numbers))
    return rows.dropna(subset=list(IDENTITY)).reset_index(drop=True)
