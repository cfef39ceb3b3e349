"""How a generalist learns: what it earns in scenarios for validation, against the steps."""

from collections.abc import Mapping

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from hyuav.envs.appearance import OKABE_ITO
from hyuav.viz.paper.style import PAGE_WIDTH, STYLE, legend_below

TOLD = {"mean": "mean", "fifth_percentile": "5th percentile", "worst": "worst"}
"""Columns of progress, and what they are called."""

COLORS = [OKABE_ITO[name] for name in ("blue", "vermillion", "bluish green")]


def progress_figure(trainings: Mapping[str, pd.DataFrame]) -> Figure:
    """The mean, the 5th percentile and the worst of what is earned, each training a line.

    Args:
        trainings: ``progress.csv`` of each, by its name in the legend.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_WIDTH, 2.4), layout="constrained")
        panels = figure.subplots(1, len(TOLD), sharex=True)
        for axes, (column, told) in zip(panels, TOLD.items(), strict=True):
            for (name, table), color in zip(trainings.items(), COLORS, strict=False):
                axes.plot(table["step"], table[column], color=color, label=name)
            axes.yaxis.set_major_formatter(PercentFormatter(1.0))
            axes.set_title(told)
            axes.set_xlabel("steps")
        panels[0].set_ylabel("of the optimum")
        if len(trainings) > 1:
            legend_below(figure, panels[0].get_legend_handles_labels()[0], len(trainings))
        return figure
