"""Learning curves of any runs in one figure, as long as they may be."""

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from hyuav.experiments.schemes import LABELS, OPTIMA
from hyuav.viz.data.curves import (
    BPS,
    NOISY,
    RETURNS,
    SMOOTHING,
    LearningCurve,
    extremes,
    learning_curves,
    quantities,
)
from hyuav.viz.data.schemes import mode_rule, scheme_color, scheme_label, scheme_line
from hyuav.viz.html.curves import add_no_helper
from hyuav.viz.html.style import DASHES, axis, base_layout, legend_below, plain

X_AXES = {
    "episode": "Episode",
    "slots": "Slots flown",
    "seconds": "Time since training began (s)",
}
"""What a curve can be drawn against."""

RUN_COLORS = (
    *("#332288", "#117733", "#CC6677", "#88CCEE", "#AA4499"),
    *("#999933", "#882255", "#44AA99", "#661100", "#6699CC"),
)
"""Paul Tol's muted colours, where a colour tells runs and not schemes apart."""

RUN_DASHES = ("solid", "dash", "dashdot", "longdash", "longdashdot")
"""Tell several runs apart where a colour tells schemes apart; dotted are the optima."""

RULE_DASHES = {"hybrid": "solid", "relay": "longdash", "jamming": "dash"}
"""Tell schemes apart by their mode rules where a colour tells runs apart."""

MOST_POINTS = 1000
"""Of a line in the figure: more than a screen has columns."""

MOST_SEEDS = 20
"""Thin lines of one run and scheme; the mean is of all learners."""

LETTERS = 36
"""Of a line of the legend: what a phone has room for."""

FEWEST_FOR_QUARTILES = 4
"""Learners of which the interquartile mean leaves some out."""


@dataclass(frozen=True)
class Choice:
    """What is drawn, and how."""

    x: str = "episode"
    y: str = NOISY
    smoothing: int = SMOOTHING
    """Episodes over which a curve is averaged."""
    color_by: str = "scheme"
    """Or "run"."""


def comparison(
    metrics: Mapping[str, pd.DataFrame],
    references: Mapping[str, Mapping[str, float]],
    choice: Choice,
    unit: str = BPS,
) -> go.Figure:
    """The curves of several runs: a thin line for each learner, and their mean.

    A colour stands for a scheme, as everywhere, and a dash pattern for a run, or where there is one
    run, as everywhere, for whether a scheme relays or jams; or, if so chosen, a colour for a run
    and a dash pattern for a scheme.

    Args:
        metrics: by the run's name.
        references: of the runs for which they are known, as :func:`.references_of`.
        choice: what is drawn.
        unit: of the rewards.
    """
    figure, several_runs = go.Figure(), len(metrics) > 1
    for place, (run, rows) in enumerate(metrics.items()):
        curves = list(learning_curves(rows, choice.y, choice.x))
        several_horizons = len({curve.num_slots for curve in curves}) > 1
        behind = f", {run}" if several_runs else ""
        for curve in curves:
            label = scheme_label(curve.scheme)
            label += f", T = {curve.num_slots}" if several_horizons else ""
            line = _line(choice, place, curve.scheme, several_runs=several_runs)
            smooth = curve.smoothed(choice.smoothing)
            figure.add_traces(list(_traces(smooth, f"{label}{behind}", f"{run}/{label}", line)))
            rule = mode_rule(curve.scheme)
            optimum = references.get(run, {}).get(rule)
            if optimum is not None and choice.y in RETURNS and not several_horizons:
                figure.add_hline(
                    y=optimum,
                    line={"color": line["color"], "width": 1, "dash": "dot"},
                    name=_lines(f"{LABELS[OPTIMA[rule]]}{behind}"),
                    showlegend=True,
                )
        if choice.y in RETURNS and not several_horizons:
            add_no_helper(figure, references.get(run, {}), behind, _lines)
    named = [trace for trace in figure.data if trace.showlegend is not False]
    figure.update_layout(
        **base_layout(),
        xaxis=axis(X_AXES[choice.x], rangemode="tozero"),
        yaxis=axis(plain(quantities(metrics, unit).get(choice.y, choice.y))),
        height=min(460 + 20 * max(len(named) - 4, 0), 760),  # a legend takes up to half of it
        margin={"l": 8, "r": 24, "t": 12, "b": 8},
        showlegend=True,
        legend=legend_below(y=-0.2),
        uirevision="-".join(("curves", choice.x, choice.y)),  # a zoom outlives new rows
    )
    return figure


def _line(choice: Choice, run: int, scheme: str, *, several_runs: bool) -> dict[str, Any]:
    if choice.color_by == "run":
        dash = RULE_DASHES.get(mode_rule(scheme), "dashdot")
        return {"color": RUN_COLORS[run % len(RUN_COLORS)], "dash": dash}
    own = RUN_DASHES[run % len(RUN_DASHES)] if several_runs else DASHES[scheme_line(scheme)]
    return {"color": scheme_color(scheme), "dash": own}


def _traces(
    curve: LearningCurve, label: str, group: str, line: dict[str, Any]
) -> Iterator[go.Scatter]:
    """All learners' lines as one trace, so that hundreds stay responsive, and their mean."""
    x, count = curve.learners.index.to_numpy(dtype=float), curve.learners.shape[1]
    if count > 1:
        parts = [
            extremes(x, curve.learners[learner].to_numpy(dtype=float), MOST_POINTS)
            for learner in curve.learners.columns[:MOST_SEEDS]
        ]
        gap = np.array([[np.nan], [np.nan]])
        xs, ys = np.hstack([line for part in parts for line in (part, gap)])
        yield go.Scatter(
            x=xs,
            y=ys,
            mode="lines",
            line={"color": line["color"], "width": 0.7},
            opacity=0.35,
            legendgroup=group,
            showlegend=False,
            hoverinfo="skip",
        )
    middle_x, middle_y = extremes(x, curve.middle(), MOST_POINTS)
    kind = "interquartile mean" if count >= FEWEST_FOR_QUARTILES else "mean"
    yield go.Scatter(
        x=middle_x,
        y=middle_y,
        mode="lines+markers" if len(middle_x) == 1 else "lines",
        line={**line, "width": 2},
        legendgroup=group,
        name=_lines(label if count == 1 else f"{label} ({kind} of {count})"),
        hovertemplate="%{x:,.6~g}: %{y:.4~g}<extra>%{fullData.name}</extra>",
    )


def _lines(label: str) -> str:
    """A label for the legend, on as many lines as it takes."""
    return "<br>".join(plain(line) for line in textwrap.wrap(label, LETTERS))
