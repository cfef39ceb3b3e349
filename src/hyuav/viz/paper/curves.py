"""Accumulated reward against episodes: the paper's Fig. 2."""

from collections.abc import Iterable

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hyuav.experiments.schemes import NO_HELPER
from hyuav.viz.data.curves import BPS, NOISY, axis_title
from hyuav.viz.data.schemes import COLORS, is_apart, scheme_label, scheme_line
from hyuav.viz.paper.style import COLUMN_WIDTH, LINES, STYLE, legend_below


def learning_figure(table: pd.DataFrame) -> Figure:
    """Accumulated reward against episodes, with bands, and the optimum of each scheme as a line.

    What comes without a helper is a line too, or where it would squash the curves, a number.

    Args:
        table: of :func:`.learning_table`, of one training or several, each of which has a panel;
            its ``attrs`` may tell the ``unit`` of the reward, and what comes without a helper.
    """
    trainings = list(dict.fromkeys(table["training"]))
    with mpl.rc_context(STYLE):
        size = (COLUMN_WIDTH, 0.6 + 1.9 * len(trainings))
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(trainings), squeeze=False, sharex=True, sharey=True)[:, 0]
        for axes, training in zip(panels, trainings, strict=True):
            for name, curve in table[table["training"] == training].groupby("scheme", sort=False):
                scheme = str(name)
                color, episodes = COLORS[scheme], curve["episode"]
                optimum = curve["optimum"].iloc[0]
                axes.axhline(optimum, color=color, linewidth=0.9, linestyle=LINES["dotted"])
                axes.fill_between(
                    episodes, curve["low"], curve["high"], color=color, alpha=0.2, linewidth=0
                )
                label, line = scheme_label(scheme), LINES[scheme_line(scheme)]
                axes.plot(episodes, curve["iqm"], color=color, ls=line, lw=1.2, label=label)
            axes.set_title(training)
            axes.margins(x=0.0)
            axes.grid()
            axes.set_axisbelow(True)
        dotted = LINES["dotted"]
        panels[-1].plot([], [], color="0.3", linewidth=0.9, linestyle=dotted, label="its optimum")
        panels[-1].set_xlabel("Episode")
        if (alone := table.attrs.get(NO_HELPER)) is not None:
            _add_no_helper(panels, alone)
        handles, _ = panels[-1].get_legend_handles_labels()
        legend_below(figure, handles, 4 if len(handles) < 5 else 3, 2.0)
        figure.supylabel(axis_title(NOISY, table.attrs.get("unit", BPS)), fontsize=8)
        return figure


def _add_no_helper(panels: Iterable[Axes], value: float) -> None:
    label = scheme_label(NO_HELPER)
    for axes in panels:
        if is_apart(value, axes.get_ylim()[1]):
            axes.plot([], [], linestyle="none", label=f"{label}: {value:.4g}")
        else:
            axes.axhline(value, color=COLORS[NO_HELPER], linewidth=0.9, label=label)
