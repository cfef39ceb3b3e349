"""The figures of a comparison, as Plotly figures."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from hyuav.experiments.comparison.statistics import learning_curves
from hyuav.experiments.comparison.tables import label
from hyuav.viz.data.comparison import entry_color, entry_line, profiles
from hyuav.viz.data.schemes import GREY
from hyuav.viz.html.curves import add_band
from hyuav.viz.html.style import (
    DASHES,
    GRID_COLOR,
    axis,
    base_layout,
    legend_below,
    plain,
    translucent,
)

_ENTRY_DASHES = ("solid", "8px,4px", "2px,3px", "10px,3px,2px,3px", "18px,4px")
_ENTRY_MARKERS = ("circle", "square", "triangle-up", "diamond", "triangle-down")
"""Of :func:`hyuav.viz.data.comparison.entry_line`."""

_LEGEND = legend_below(yref="container", y=0.01, yanchor="bottom")
"""60 pixels below the plot whatever its height, as the axis titles need that much."""


def comparison_figures(
    results: pd.DataFrame, curves: pd.DataFrame, cells: pd.DataFrame, threshold: float
) -> Iterator[tuple[str, str, go.Figure]]:
    """The figures of a comparison, each with its heading and its title.

    Args:
        results: a row per learner, as :class:`.comparison.directory.Summary` holds them.
        curves: a row per evaluation in training, likewise.
        cells: a row per algorithm, scenario, scheme and horizon, likewise.
        threshold: share of the optimum that counts as solved, drawn as a line.
    """
    yield (
        "Share of the optimum",
        "Interquartile means with 95 % intervals",
        cells_figure(cells, threshold),
    )
    yield (
        "Learning curves",
        "Interquartile means of the best weights so far, with 95 % intervals",
        bands_figure(
            learning_curves(curves),
            ("episode", "Training episodes"),
            ("iqm", "Share of the optimum (%)"),
            threshold,
        ),
    )
    yield (
        "Performance profiles",
        "Share of learners that reach a share of the optimum, with 95 % intervals",
        bands_figure(
            profiles(results),
            ("fraction", "Share of the optimum, τ (%)"),
            ("share", "Learners that reach τ (%)"),
            threshold,
        ),
    )


def cells_figure(cells: pd.DataFrame, threshold: float) -> go.Figure:
    """Each cell's interquartile mean with its interval, and its worst learner as a tick.

    Args:
        cells: as :func:`hyuav.experiments.comparison.statistics.summarize_cells` gives them.
        threshold: share of the optimum, drawn as a line.
    """
    figure = go.Figure(layout=base_layout())
    names = [
        f"{plain(row.scenario)}<br>{plain(row.scheme)}, T = {row.num_slots}"
        for row in cells.itertuples()
    ]
    rows = list(dict.fromkeys(names))
    algorithms = list(dict.fromkeys(cells["algorithm"]))
    for place, algorithm in enumerate(algorithms):
        chosen = (cells["algorithm"] == algorithm).to_numpy()
        shift = ((len(algorithms) - 1) / 2 - place) * 0.8 / len(algorithms)
        y = [len(rows) - 1 - rows.index(name) + shift for name in np.array(names)[chosen]]
        _add_cells(figure, str(algorithm), cells[chosen], y)
    figure.add_scatter(x=[None], y=[None], mode="markers", marker=_tick(GREY), name="worst learner")
    for boundary in range(len(rows) - 1):
        figure.add_hline(y=boundary + 0.5, line={"color": GRID_COLOR, "width": 1})
    line = {"color": GREY, "width": 1.2, "dash": DASHES["dotted"]}
    figure.add_vline(x=100 * threshold, line=line)
    height, below = 26 + 9 * len(algorithms), _legend_height(len(algorithms) + 1)
    figure.update_layout(
        height=60 + below + len(rows) * height,
        margin={"l": 110, "r": 20, "t": 20, "b": below},
        xaxis=axis("Share of the optimum (%)", nticks=7),
        yaxis=axis("", range=[-0.5, len(rows) - 0.5], showgrid=False)
        | {"tickvals": list(range(len(rows))), "ticktext": rows[::-1]},
        legend=_LEGEND,
    )
    return figure


def _add_cells(figure: go.Figure, algorithm: str, cells: pd.DataFrame, y: list[float]) -> None:
    """An algorithm's cells at the heights ``y``."""
    hue, text = entry_color(algorithm), plain(label(algorithm))
    figure.add_scatter(
        x=(100 * cells["worst"]).tolist(),
        y=y,
        mode="markers",
        marker=_tick(hue),
        legendgroup=text,
        showlegend=False,
        hovertemplate=f"{text}, worst: %{{x:.1f}} %<extra></extra>",
    )
    figure.add_scatter(
        x=(100 * cells["iqm"]).tolist(),
        y=y,
        error_x={
            "array": (100 * (cells["high"] - cells["iqm"])).tolist(),
            "arrayminus": (100 * (cells["iqm"] - cells["low"])).tolist(),
            "width": 0,
            "thickness": 2,
        },
        mode="markers",
        marker={"color": hue, "size": 7, "symbol": _ENTRY_MARKERS[entry_line(algorithm)]},
        name=text,
        legendgroup=text,
        hovertemplate=f"{text}: %{{x:.1f}} %<extra></extra>",
    )


def _tick(color: str) -> dict[str, Any]:
    """The marker of a worst learner."""
    return {"symbol": "line-ns", "size": 10, "line": {"color": color, "width": 1.6}}


def bands_figure(
    rows: pd.DataFrame, x: tuple[str, str], y: tuple[str, str], threshold: float
) -> go.Figure:
    """Lines with their 95 % intervals, one for each algorithm.

    Args:
        rows: with ``algorithm``, both columns, ``low`` and ``high``; shares are drawn in percent.
        x: column and title of the horizontal axis.
        y: column and title of the vertical axis.
        threshold: share of the optimum, drawn as a line.
    """
    figure = go.Figure(layout=base_layout())
    scale = 100 if x[0] == "fraction" else 1
    for algorithm, own in rows.groupby("algorithm", sort=False):
        hue, text = entry_color(str(algorithm)), plain(label(str(algorithm)))
        across = (scale * own[x[0]]).tolist()
        low, high = ((100 * own[name]).tolist() for name in ("low", "high"))
        add_band(figure, across, low, high, translucent(hue, 0.2), text)
        figure.add_scatter(
            x=across,
            y=(100 * own[y[0]]).tolist(),
            mode="lines",
            line={"color": hue, "width": 2.2, "dash": _ENTRY_DASHES[entry_line(str(algorithm))]},
            name=text,
            legendgroup=text,
            hovertemplate=f"{text}, %{{x:.4g}}: %{{y:.1f}} %<extra></extra>",
        )
    line = {"color": GREY, "width": 1.2, "dash": DASHES["dotted"]}
    if scale == 100:
        figure.add_vline(x=100 * threshold, line=line)
    else:
        figure.add_hline(y=100 * threshold, line=line)
    below = _legend_height(rows["algorithm"].nunique())
    figure.update_layout(
        height=320 + below,
        margin={"l": 60, "r": 20, "t": 20, "b": below},
        xaxis=axis(x[1], nticks=7),
        yaxis=axis(y[1], nticks=8),
        legend=_LEGEND,
    )
    return figure


def _legend_height(entries: int) -> int:
    """Pixels below a plot for its axis title and a legend of four entries in a row."""
    return 80 + 20 * math.ceil(entries / 4)
