"""What all figures have in common: sizes, fonts, each scheme's color and line, and their files."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure

from hyuav._support.files import write_durably
from hyuav.envs.rendering import OKABE_ITO

COLUMN_WIDTH, PAGE_WIDTH = 3.5, 7.16
"""Inches of one column and of both columns of an IEEE page."""

COMPARED = ("proposed", "ja_ot", "re_ot", "re_lt", "ja_lt")
"""The five schemes of the paper."""

COLORS = {
    "proposed": OKABE_ITO["bluish green"],
    "ja_ot": OKABE_ITO["vermillion"],
    "re_ot": OKABE_ITO["blue"],
    "re_lt": OKABE_ITO["sky blue"],
    "ja_lt": OKABE_ITO["orange"],
}
"""The same color for a scheme in every figure."""

COLORS |= {f"{scheme}_paper": COLORS[scheme] for scheme in ("proposed", "ja_ot", "re_ot")}
COLORS |= {
    "optimum": COLORS["proposed"],
    "ja_optimum": COLORS["ja_ot"],
    "re_optimum": COLORS["re_ot"],
}

LINES: dict[str, Any] = {
    scheme: (0, (4, 1.5)) if scheme.startswith("ja_") else "solid" for scheme in COMPARED
}
"""Solid for a scheme that relays, dashed for one that only jams."""

DOTTED: Any = (0, (1, 1.5))
"""The line of every optimum."""

STYLE: Any = {
    "font.size": 8,
    "axes.linewidth": 0.6,
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
            write_durably(directory / f"{name}.{suffix}", drawn.getbuffer())
    save_tables(directory, name, tables or {})


def save_tables(directory: Path, name: str, tables: Mapping[str, pd.DataFrame]) -> None:
    """Write the tables of a figure, as :func:`save_figure` names them."""
    for key, table in tables.items():
        file = f"{name}_{key}.csv" if key else f"{name}.csv"
        text = table.to_csv(index=False, float_format="%.6g")
        write_durably(directory / file, text.encode())
