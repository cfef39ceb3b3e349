"""Secrecy sum-rate against the time horizon: the paper's Fig. 4."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hyuav.experiments.schemes import LABELS, NO_HELPER, PROPOSED_POWER
from hyuav.viz.data.schemes import BEST, COLORS, COMPARED, DRAWN, is_apart, scheme_line
from hyuav.viz.paper.style import COLUMN_WIDTH, LINES, STYLE, legend_below

TITLE = "Secrecy sum-rate (bps/Hz)"
"""Of what is earned by default."""

MARKERS = {"proposed": "o", "ja_ot": "s", "re_ot": "^", "re_lt": "v", "ja_lt": "D"}
MARKERS |= {NO_HELPER: "P", PROPOSED_POWER: "*"}


def sum_rates_by_horizon(table: pd.DataFrame) -> Figure:
    """Secrecy sum-rate against the horizon, for the schemes and the optimum of each mode rule.

    What would squash the paper's schemes stands above a break of the vertical axis.

    Args:
        table: of :func:`.horizon_table`; its ``attrs`` may tell the ``title`` of another reward.
    """
    with mpl.rc_context(STYLE):
        curves = {str(name): rows for name, rows in table.groupby("scheme")}
        drawn = [name for name in (*BEST, *DRAWN) if name in curves]
        apart = _apart(curves)
        aside: dict[str, float] = {}
        for shown in (apart, set(drawn) - apart):
            own = [name for name in drawn if name in shown]
            aside |= dict(zip(own, _aside(len(own), table["num_slots"]), strict=True))
        figure, upper, lower = _broken_axes(broken=bool(apart))
        handles = []
        for scheme in drawn:
            rows, learned = curves[scheme], scheme in DRAWN
            bars = (upper if scheme in apart else lower).errorbar(
                rows["num_slots"] + aside[scheme],
                rows["mean"],
                yerr=[rows["mean"] - rows["low"], rows["high"] - rows["mean"]],
                color=COLORS[scheme],
                linestyle=LINES[scheme_line(scheme)],
                marker=MARKERS.get(scheme, ""),
                capsize=2.0 if learned else 1.0,
                elinewidth=0.8,
                label=LABELS[scheme],
            )
            if learned:
                handles.append(bars)
        optimum = Line2D([], [], color="0.3", linestyle=LINES["dotted"], label="its optimum")
        lower.set_xticks(sorted(set(table["num_slots"])))
        lower.set_xlabel("Time horizon (slots)")
        figure.supylabel(table.attrs.get("title", TITLE), fontsize=STYLE["axes.labelsize"])
        for axes, shown in ((lower, set(drawn) - apart), (upper, apart)):
            highest = max((curves[scheme]["mean"].max() for scheme in shown), default=0.0)
            if highest:  # few learners may have wider intervals
                axes.set_ylim(0.0, 1.08 * highest)
            axes.grid()
            axes.set_axisbelow(True)
        if apart:
            least = min(curves[scheme]["mean"].min() for scheme in apart)
            upper.set_ylim(bottom=0.8 * least)
        legend_below(figure, [*handles, optimum], 3, 1.2)
        return figure


def _apart(curves: Mapping[str, pd.DataFrame]) -> set[str]:
    """The schemes that would squash those of the paper."""
    papers = [curves[scheme]["mean"].max() for scheme in COMPARED if scheme in curves]
    if not papers:
        return set()
    return {name for name, rows in curves.items() if is_apart(rows["mean"].max(), max(papers))}


def _broken_axes(*, broken: bool) -> tuple[Figure, Axes, Axes]:
    """A figure with the axes above and below the break, which are the same without one."""
    size = (COLUMN_WIDTH, 3.9 if broken else 3.0)
    figure = Figure(figsize=size, layout="constrained")
    if not broken:
        axes = figure.add_subplot()
        return figure, axes, axes
    upper, lower = figure.subplots(2, sharex=True, height_ratios=(1.0, 2.4))
    upper.spines.bottom.set_visible(False)
    lower.spines.top.set_visible(False)
    upper.tick_params(axis="x", bottom=False)
    slash = {"marker": [(-1, -0.6), (1, 0.6)], "markersize": 8, "linestyle": "none"}
    slash |= {"color": "black", "markeredgewidth": 0.6, "clip_on": False}
    upper.plot([0, 1], [0, 0], transform=upper.transAxes, **slash)
    lower.plot([0, 1], [1, 1], transform=lower.transAxes, **slash)
    return figure, upper, lower


def _aside(curves: int, horizons: "pd.Series[int]") -> list[float]:
    """How far each curve is moved along the axis, in slots, so that no bar hides another."""
    places = np.unique(horizons)
    gap = float(np.diff(places).min()) if len(places) > 1 else 1.0
    return [0.025 * gap * (curve - (curves - 1) / 2) for curve in range(curves)]
