"""The map of regimes: which scheme is best over two parameters, and what power control adds."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes as Panel
from matplotlib.colors import BoundaryNorm, to_rgba
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hyuav.viz.data.regimes import (
    GAIN_LEVELS,
    LABELS,
    NOTHING,
    REGIME_COLORS,
    STEPS,
    RegimeMap,
    axis_label,
    edges,
    shade,
)
from hyuav.viz.paper.style import PAGE_WIDTH, STYLE, legend_below

_HATCH: Any = {"hatch": "//////", "edgecolor": "0.75", "linewidth": 0.0}
_OWN: Any = {
    "marker": "*",
    "markersize": 9.0,
    "color": "white",
    "markeredgecolor": "black",
    "markeredgewidth": 0.8,
    "linestyle": "",
}


def regimes_figure(found: RegimeMap) -> Figure:
    """Where which scheme is best at fixed power, and what power control brings beyond it.

    Args:
        found: the map.
    """
    with mpl.rc_context(STYLE | {"hatch.linewidth": 0.6}):
        figure = Figure(figsize=(PAGE_WIDTH, 3.3), layout="constrained")
        best, gain = figure.subplots(1, 2, sharex=True, sharey=True)
        _draw_best(best, found)
        _draw_gain(figure, gain, found)
        for panel in (best, gain):
            _finish(panel, found)
        best.set_ylabel(axis_label(found.axes.y))
        _add_legend(figure, found)
        return figure


def _draw_best(panel: Panel, found: RegimeMap) -> None:
    names, shades = found.grid("best"), found.shades
    colors = np.empty((*names.shape, 4))
    for place, name in np.ndenumerate(names):
        color = shade(REGIME_COLORS[name], int(shades[place]))
        colors[place] = to_rgba(color, 0.0 if name == NOTHING else 1.0)
    panel.pcolormesh(edges(found.axes.x), edges(found.axes.y), colors, rasterized=True)
    panel.set_title("(a) Best scheme at fixed power")


def _draw_gain(figure: Figure, panel: Panel, found: RegimeMap) -> None:
    gains = found.grid("gain")
    most = gains[np.isfinite(gains)].max(initial=1.0)
    levels = [1.0, *(level for level in GAIN_LEVELS if level < most)]
    levels += [level for level in GAIN_LEVELS if level >= most][:1]
    # What is random lets some gains be a little below 1.
    shown = np.ma.masked_invalid(np.where(np.isposinf(gains), 1e9, np.maximum(gains, 1.0)))
    beyond = bool((shown >= levels[-1]).any())
    norm = BoundaryNorm(levels, 256, extend="max" if beyond else "neither")
    cells = edges(found.axes.x), edges(found.axes.y)
    mesh = panel.pcolormesh(*cells, shown, cmap="viridis", norm=norm, rasterized=True)
    bar = figure.colorbar(mesh, ax=panel, spacing="uniform", aspect=25, ticks=levels)
    bar.ax.set_yticklabels([f"{level:g}" for level in levels])
    bar.ax.minorticks_off()
    bar.set_label("Times the best at fixed power")
    panel.set_title("(b) What power control adds")


def _finish(panel: Panel, found: RegimeMap) -> None:
    x, y = found.axes.x, found.axes.y
    panel.set(xscale=x.scale, yscale=y.scale, xlabel=axis_label(x))
    panel.set_xlim(edges(x)[0], edges(x)[-1])
    panel.set_ylim(edges(y)[0], edges(y)[-1])
    panel.patch.set(**_HATCH)
    panel.plot(*found.own, zorder=5, **_OWN)


def _add_legend(figure: Figure, found: RegimeMap) -> None:
    """Each regime with its shades, and what these stand for."""
    regimes = [name for name in found.present if name != NOTHING]
    shades = range(len(STEPS) + 1)
    handles: list[Any] = [
        tuple(Patch(facecolor=shade(REGIME_COLORS[name], number)) for number in shades)
        for name in regimes
    ]
    labels = [LABELS[name] for name in regimes]
    if NOTHING in found.present:
        handles.append(Patch(facecolor="white", **_HATCH))
        labels.append(LABELS[NOTHING])
    handles.append(Line2D([], [], **_OWN))
    labels.append(found.own_label)
    steps = ", ".join(f"up to {step:g}" for step in STEPS)
    legend_below(
        figure,
        handles,
        len(handles),
        1.6,
        labels=labels,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)},
        handlelength=4.0,
        title=f"Light to full color: {steps}, and over {STEPS[-1]:g} times the best of the others",
        title_fontsize=7,
    )
