"""A comparison's figures: cells, learning curves, performance profiles, improvements."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from hyuav.envs.rendering import OKABE_ITO
from hyuav.experiments.comparison.directory import Summary
from hyuav.experiments.comparison.plan import ENTRIES, PIECES, Compare
from hyuav.experiments.comparison.statistics import learning_curves, performance_profiles
from hyuav.experiments.comparison.tables import MOST_COLUMNS, label
from hyuav.learning.registry import ALGORITHMS, PEER
from hyuav.viz.paper import COLUMN_WIDTH, PAGE_WIDTH, STYLE, save_figure

_OTHERS = ("bluish green", "blue", "orange", "reddish purple", "sky blue", "yellow", "black")

COLORS = {name: OKABE_ITO[_OTHERS[i % len(_OTHERS)]] for i, name in enumerate(ENTRIES)} | {
    PEER: OKABE_ITO["vermillion"]
}
"""The same color for an algorithm in every figure."""

_UNKNOWN = "#777777"
"""Of an algorithm or a piece that is not offered now: another user's own, an earlier version's."""

_DASHES: Sequence[Any] = (
    "solid",
    *((0, lengths) for lengths in ((4, 1.5), (1, 1.2), (6, 1.2, 1, 1.2), (9, 2))),
)

_MARKERS = "os^Dv"

FRACTION = "Fraction of the optimum"


def color(entry: str) -> str:
    """An entry's color; a variant without a piece has that of the piece."""
    piece = entry.partition("-")[2]
    if piece in PIECES:
        return OKABE_ITO[_OTHERS[PIECES.index(piece) % len(_OTHERS)]]
    own = list(ALGORITHMS).index(entry) if entry in ALGORITHMS else None
    known = _UNKNOWN if own is None else OKABE_ITO[_OTHERS[own % len(_OTHERS)]]
    return _UNKNOWN if piece else COLORS.get(entry, known)


def dash(entry: str) -> int:
    """Which line and marker tell an entry from others of its color; 0 of a whole algorithm."""
    piece = entry.partition("-")[2]
    return 1 + PIECES.index(piece) // len(_OTHERS) if piece in PIECES else 0


def draw(summary: Summary, options: Compare, directory: Path) -> None:
    """Write the figures as PNG and PDF, and as CSV what they show.

    Args:
        summary: of the comparison.
        options: with the threshold.
        directory: for the files.
    """
    results, threshold = summary.results, options.threshold
    save_figure(cell_means(summary.cells), directory, "cells", {"": summary.cells})
    curves = learning_curves(summary.curves)
    if len(curves):
        figure = curves_figure(curves, threshold)
        save_figure(figure, directory, "learning_curves", {"": curves})
    lowest = max(math.floor(20 * results["fraction"].min()) / 20, 0.0)
    profiles = performance_profiles(results, np.linspace(min(lowest, 0.95), 1.0, 101))
    figure = profiles_figure(profiles, threshold)
    save_figure(figure, directory, "performance_profiles", {"": profiles})
    if len(summary.improvements):
        figure, table = improvement_bars(summary.improvements), summary.improvements
        save_figure(figure, directory, "improvement", {"": table})


def cell_means(cells: pd.DataFrame) -> Figure:
    """Each cell's interquartile mean with its interval, and its worst learner as a tick.

    Args:
        cells: as :func:`.statistics.summarize_cells` gives them.
    """
    groups = list(cells.groupby(["scenario", "num_slots"], sort=False))
    algorithms, schemes = (list(dict.fromkeys(cells[name])) for name in ("algorithm", "scheme"))
    columns = min(len(groups), 2)
    rows = math.ceil(len(groups) / columns)
    height = 0.35 + 0.13 * len(schemes) * (len(algorithms) + 1)
    with mpl.rc_context(STYLE):
        figure = Figure(
            figsize=(PAGE_WIDTH if columns > 1 else COLUMN_WIDTH, rows * height + 0.55),
            layout="constrained",
        )
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flatten()
        for axes, ((scenario, num_slots), group) in zip(panels, groups, strict=False):
            _draw_cells(axes, group, algorithms, schemes)
            axes.set_title(f"{scenario}, T = {num_slots}", fontsize=8)
        for axes in panels[len(groups) :]:
            axes.set_visible(False)
        for axes in panels[max(len(groups) - columns, 0) : len(groups)]:
            axes.set_xlabel(f"{FRACTION} (IQM, 95 % interval)")
            axes.tick_params(labelbottom=True)
        worst = Line2D([], [], color="0.3", marker="|", linestyle="", label="worst learner")
        _add_legend(figure, [*(_handle(name) for name in algorithms), worst])
        return figure


def _draw_cells(
    axes: Axes, cells: pd.DataFrame, algorithms: Sequence[str], schemes: Sequence[str]
) -> None:
    step = 1.0 / (len(algorithms) + 1)
    for _, cell in cells.iterrows():
        name = cell["algorithm"]
        offset = (algorithms.index(name) - (len(algorithms) - 1) / 2) * step
        y = schemes.index(cell["scheme"]) + offset
        axes.plot([cell["low"], cell["high"]], [y, y], color=color(str(name)), linewidth=1.4)
        axes.plot(cell["iqm"], y, _MARKERS[dash(str(name))], color=color(str(name)))
        axes.plot(cell["worst"], y, "|", color=color(str(name)), markersize=6.0)
    axes.set_yticks(range(len(schemes)), schemes)
    axes.set_ylim(len(schemes) - 0.5, -0.5)
    axes.xaxis.set_major_formatter(_percent)
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    for boundary in range(1, len(schemes)):
        axes.axhline(boundary - 0.5, color="0.85", linewidth=0.5)
    axes.grid(color="0.92", linewidth=0.5, axis="x")


def _percent(value: float, _: float) -> str:
    return f"{100 * value:g} %"


def _handle(algorithm: str) -> Line2D:
    marker = _MARKERS[dash(algorithm)]
    return Line2D([], [], color=color(algorithm), marker=marker, label=label(algorithm))


def _add_legend(figure: Figure, handles: Sequence[Line2D]) -> None:
    """Below the axes, in as many columns as fit, the figure being made as much higher."""
    width, height = figure.get_size_inches()
    column = 0.45 + 0.05 * max(len(str(handle.get_label())) for handle in handles)
    columns = min(max(int(width / column), 1), len(handles))
    figure.set_size_inches(width, height + 0.15 * math.ceil(len(handles) / columns))
    figure.legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        columnspacing=1.2,
    )


def curves_figure(curves: pd.DataFrame, threshold: float) -> Figure:
    """What the best weights so far earn against the episodes, over all learners.

    Args:
        curves: as :func:`.statistics.learning_curves` gives them.
        threshold: share of the optimum, drawn as a line.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 2.6), layout="constrained")
        axes = figure.add_subplot()
        handles = _draw_bands(axes, curves, "episode", "iqm")
        axes.axhline(threshold, color="0.3", linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.set(xlabel="Training episodes", ylabel=f"{FRACTION} (IQM)")
        axes.yaxis.set_major_formatter(_percent)
        _add_legend(figure, handles)
        return figure


def profiles_figure(profiles: pd.DataFrame, threshold: float) -> Figure:
    """The share of learners that reach each fraction of the optimum.

    Args:
        profiles: as :func:`.statistics.performance_profiles` gives them.
        threshold: share of the optimum, drawn as a line.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 2.6), layout="constrained")
        axes = figure.add_subplot()
        handles = _draw_bands(axes, profiles, "fraction", "share")
        axes.axvline(threshold, color="0.3", linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.set(xlabel=f"{FRACTION}, $\\tau$", ylabel="Learners that reach $\\tau$ or more")
        axes.set_ylim(-0.02, 1.04)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(_percent)
        _add_legend(figure, handles)
        return figure


def _draw_bands(axes: Axes, rows: pd.DataFrame, x: str, y: str) -> list[Line2D]:
    """The lines with their bands; returned are the lines."""
    lines = []
    for name, own in rows.groupby("algorithm", sort=False):
        hue = color(str(name))
        axes.fill_between(own[x], own["low"], own["high"], color=hue, alpha=0.15, linewidth=0)
        lines += axes.plot(
            own[x],
            own[y],
            color=hue,
            linestyle=_DASHES[dash(str(name))],
            linewidth=1.3,
            label=label(str(name)),
        )
    axes.margins(x=0.0)
    axes.grid(color="0.92", linewidth=0.5)
    return lines


def improvement_bars(improvements: pd.DataFrame) -> Figure:
    """How probably a learner of one algorithm is better than one of another.

    All pairs are shown, the algorithm on the left beside that on the right; where there are more
    than :data:`MOST_COLUMNS` algorithms, the first beside each other one.

    Args:
        improvements: as :func:`.statistics.improvements` gives them.
    """
    names = list(dict.fromkeys(improvements["algorithm"]))
    order = improvements["algorithm"].map(names.index) < improvements["other"].map(names.index)
    pairs = improvements[order]
    alone = len(names) > MOST_COLUMNS
    if alone:
        pairs = pairs[pairs["algorithm"] == names[0]]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 0.75 + 0.2 * len(pairs)), layout="constrained")
        axes = figure.add_subplot()
        places = range(len(pairs))
        for place, (_, pair) in zip(places, pairs.iterrows(), strict=True):
            hue = color(pair["algorithm"])
            axes.barh(place, pair["high"] - pair["low"], 0.6, pair["low"], color=hue, alpha=0.35)
            axes.plot(
                [pair["probability"]] * 2, [place - 0.3, place + 0.3], color=hue, linewidth=1.8
            )
        axes.axvline(0.5, color="0.3", linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.set_yticks(places, [label(name) for name in pairs["other" if alone else "algorithm"]])
        axes.set_ylim(len(pairs) - 0.4, -0.6)
        axes.set_xlim(-0.02, 1.02)
        better = label(names[0]) if alone else "left"
        axes.set_xlabel(f"P({better} better than {'the other' if alone else 'right'})")
        axes.xaxis.set_major_formatter(_percent)
        axes.grid(color="0.92", linewidth=0.5, axis="x")
        axes.set_axisbelow(True)
        if not alone:
            right = axes.secondary_yaxis("right")
            right.set_yticks(places, [label(name) for name in pairs["other"]])
        return figure
