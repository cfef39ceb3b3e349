"""Secrecy sum-rate against the time horizon: the paper's Fig. 4."""

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hyuav.experiments.schemes import LABELS, OPTIMA
from hyuav.viz.data.schemes import COLORS, COMPARED, scheme_line
from hyuav.viz.paper.style import COLUMN_WIDTH, LINES, STYLE, legend_below

TITLE = "Secrecy sum-rate (bps/Hz)"
"""Of what is earned by default."""

MARKERS = {"proposed": "o", "ja_ot": "s", "re_ot": "^", "re_lt": "v", "ja_lt": "D"}


def sum_rates_by_horizon(table: pd.DataFrame) -> Figure:
    """Secrecy sum-rate against the horizon, for the schemes and the optimum of each mode rule.

    Args:
        table: of :func:`.horizon_table`; its ``attrs`` may tell the ``title`` of another reward.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 3.0), layout="constrained")
        axes = figure.add_subplot()
        curves = {str(name): rows for name, rows in table.groupby("scheme")}
        drawn = [name for name in (*OPTIMA.values(), *COMPARED) if name in curves]
        aside = dict(zip(drawn, _aside(len(drawn), table["num_slots"]), strict=True))
        handles = []
        for scheme in drawn:
            rows, learned = curves[scheme], scheme in COMPARED
            bars = axes.errorbar(
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
        axes.set_xticks(sorted(set(table["num_slots"])))
        axes.set(xlabel="Time horizon (slots)", ylabel=table.attrs.get("title", TITLE))
        axes.set_ylim(0.0, 1.08 * table["mean"].max())  # few learners may have wider intervals
        axes.grid()
        axes.set_axisbelow(True)
        legend_below(figure, [*handles, optimum], 3, 1.2)
        return figure


def _aside(curves: int, horizons: "pd.Series[int]") -> list[float]:
    """How far each curve is moved along the axis, in slots, so that no bar hides another."""
    places = np.unique(horizons)
    gap = float(np.diff(places).min()) if len(places) > 1 else 1.0
    return [0.025 * gap * (curve - (curves - 1) / 2) for curve in range(curves)]
