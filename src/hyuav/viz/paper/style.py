"""What all figures have in common: sizes, fonts, lines, grid and legend, and their files."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure

from hyuav._support.files import write_durably
from hyuav.envs.appearance import OKABE_ITO
from hyuav.viz.data.schemes import Line

COLUMN_WIDTH, PAGE_WIDTH = 3.5, 7.16
"""Inches of one column and of both columns of an IEEE page."""

LINES: dict[Line, Any] = {"solid": "solid", "dashed": (0, (4, 1.5)), "dotted": (0, (1, 1.5))}
"""The lines of :func:`hyuav.viz.data.schemes.scheme_line`."""

MODE_COLORS = {
    "neither": "0.88",
    "jamming": OKABE_ITO["reddish purple"],
    "relay": OKABE_ITO["yellow"],
}
"""Where no mode earns anything, and the modes, in the order of the map's values.

None is the color of a scheme or of a node.
"""

STYLE: Any = {
    "font.size": 8,
    "axes.linewidth": 0.6,
    "grid.color": "0.92",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "pdf.fonttype": 42,  # fonts that journals' submission checks accept
    "savefig.dpi": 300,
}


def legend_below(
    figure: Figure, handles: Sequence[Any], columns: int, spacing: float = 1.0, **more: Any
) -> None:
    """Place the legend below all axes, in so many columns that are ``spacing`` letters apart."""
    figure.legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        columnspacing=spacing,
        **more,
    )


def save_figure(
    figure: Figure,
    directory: Path,
    name: str,
    tables: Mapping[str, pd.DataFrame] | None = None,
) -> None:
    """Write the figure as ``name.png`` and ``name.pdf``, and what it shows beside it.

    Args:
        figure: to write.
        directory: for the files.
        name: of the figure.
        tables: that it was drawn from: the one called "" becomes ``name.csv``, another
            ``name_KEY.csv``.

    Raises:
        OSError: a file cannot be written; then an earlier one is still there.
    """
    with mpl.rc_context(STYLE):
        for suffix in ("png", "pdf"):
            drawn = io.BytesIO()
            figure.savefig(drawn, format=suffix)
            figure.set_layout_engine(None)  # what is laid out once stays where it is
            write_durably(directory / f"{name}.{suffix}", drawn.getbuffer())
    save_tables(directory, name, tables or {})


def save_tables(directory: Path, name: str, tables: Mapping[str, pd.DataFrame]) -> None:
    """Write the tables of a figure, as :func:`save_figure` names them."""
    for key, table in tables.items():
        file = f"{name}_{key}.csv" if key else f"{name}.csv"
        text = table.to_csv(index=False, float_format="%.6g")
        write_durably(directory / file, text.encode())
