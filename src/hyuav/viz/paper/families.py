"""How near the generalist comes to the optimum, over the scenarios of a family."""

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from hyuav.envs.appearance import OKABE_ITO
from hyuav.experiments.schemes import GENERALISTS
from hyuav.viz.data.schemes import scheme_color
from hyuav.viz.paper.style import PAGE_WIDTH, STYLE, legend_below

LEAST_LOSS, MOST_LOSS = 0.01, 20.0
"""Of the axis, in %; what is less is drawn at the least."""


def families_figure(own: pd.DataFrame) -> Figure:
    """What is lost against the optimum: its distribution, and by the number of slots.

    Args:
        own: a row for each scenario, as :func:`hyuav.experiments.families.fractions` gives.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_WIDTH, 2.9), layout="constrained")
        distribution, by_slots = figure.subplots(1, 2)
        _draw_distribution(distribution, own)
        _draw_by_slots(by_slots, own)
        handles = [
            handle
            for axes in (distribution, by_slots)
            for handle in axes.get_legend_handles_labels()[0]
        ]
        legend_below(figure, handles, 4)
        return figure


def _loss(fraction: pd.Series) -> np.ndarray:
    loss: np.ndarray = (100.0 * (1.0 - fraction.to_numpy())).clip(LEAST_LOSS, MOST_LOSS)
    return loss


def _draw_distribution(axes: Axes, own: pd.DataFrame) -> None:
    for controlled, color in ((False, OKABE_ITO["blue"]), (True, OKABE_ITO["vermillion"])):
        part = own[own["power_control"] == controlled]
        power = "power controlled" if controlled else "power fixed"
        for name, line in (("generalist", "-"), ("refined", ":")):
            loss = np.sort(_loss(part[f"{name}_fraction"]))
            told = power if name == "generalist" else f"{power}, refined"
            share = np.arange(1, len(loss) + 1) / max(len(loss), 1)
            axes.plot(loss, share, line, color=color, label=told, drawstyle="steps-post")
    axes.set_xscale("log")
    axes.set_xlim(LEAST_LOSS, MOST_LOSS)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.set_xlabel("lost against the optimum (%)")
    axes.set_ylabel("share of the scenarios")


def _draw_by_slots(axes: Axes, own: pd.DataFrame) -> None:
    for rule, scheme in GENERALISTS.items():
        part = own[own["mode_rule"] == rule]
        loss, color = _loss(part["generalist_fraction"]), scheme_color(scheme)
        axes.plot(part["num_slots"], loss, ".", color=color, markersize=4, label=rule)
    axes.set_yscale("log")
    axes.set_ylim(LEAST_LOSS * 0.8, MOST_LOSS)
    axes.set_xlabel("slots T")
    axes.set_ylabel("lost against the optimum (%)")
