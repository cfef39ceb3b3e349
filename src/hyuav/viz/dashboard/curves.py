"""Learning curves of any runs in one figure, as long as they may be."""

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from numpy.typing import NDArray

from hyuav.experiments.intervals import interquartile_curve
from hyuav.experiments.schemes import LABELS, LEARNED, OPTIMA
from hyuav.viz.html.style import axis, base_layout, plain, scheme_color, scheme_dash

Values = NDArray[np.float64]

X_AXES = {
    "episode": "Episode",
    "slots": "Slots flown",
    "seconds": "Time since training began (s)",
}
"""What a curve can be drawn against."""

Y_AXES = {
    "accumulated_reward": "Accumulated reward (bps/Hz)",
    "evaluation": "Noise-free return (bps/Hz)",
    "sum_rate": "Noise-free secrecy sum-rate (bps/Hz)",
    "best_evaluation": "Best noise-free return so far (bps/Hz)",
}
"""What can be drawn; the losses of the gradient steps come after."""

OF_THE_RETURN = tuple(Y_AXES)
"""What the optimum bounds."""

RUN_COLORS = (
    *("#332288", "#117733", "#CC6677", "#88CCEE", "#AA4499"),
    *("#999933", "#882255", "#44AA99", "#661100", "#6699CC"),
)
"""Paul Tol's muted colours, where a colour tells runs and not schemes apart."""

DASHES = ("solid", "dash", "dashdot", "longdash", "longdashdot")
"""Tell several runs apart where a colour tells schemes apart; dotted are the optima."""

SCHEME_DASHES = {"hybrid": "solid", "relay": "longdash", "jamming": "dash"}
"""Tell schemes apart by their rules where a colour tells runs apart."""

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
    y: str = "accumulated_reward"
    smoothing: int = 25
    """Episodes over which a curve is averaged."""
    color_by: str = "scheme"
    """Or "run"."""


@dataclass(frozen=True)
class Curves:
    """The learners of a run that share a scheme and a horizon."""

    run: str
    scheme: str
    horizon: int
    several_horizons: bool
    lines: pd.DataFrame
    """A column per learner and a row per value of x, smoothed."""

    @property
    def label(self) -> str:
        """Scheme, and horizon where there are several."""
        scheme = learned_label(self.scheme)
        return f"{scheme}, T = {self.horizon}" if self.several_horizons else scheme

    def middle(self) -> Values:
        """The interquartile mean of those learners that have not stopped."""
        return interquartile_curve(self.lines.to_numpy(dtype=float))


def learned_label(rule: str) -> str:
    """The name of what learns where ``rule`` says who chooses the mode."""
    scheme = LEARNED.get(rule, rule)
    return LABELS.get(scheme, scheme)


def axes_of(metrics: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """What can be drawn of these runs, with the axis titles."""
    names = dict.fromkeys(name for rows in metrics.values() for name in rows.columns)
    losses = sorted(name for name in names if name.startswith("loss_"))
    known = {name: title for name, title in Y_AXES.items() if name in names}
    return known | {name: f"Loss of the {name.removeprefix('loss_')}" for name in losses}


def curves_of(run: str, metrics: pd.DataFrame, choice: Choice) -> Iterator[Curves]:
    """The curves of one run, by scheme and horizon.

    Args:
        run: its name.
        metrics: as in ``metrics.csv``; columns may be missing.
        choice: what is drawn.
    """
    if not {choice.x, choice.y} <= set(metrics.columns):
        return
    rows = metrics.dropna(subset=[choice.x, choice.y, "num_slots"])
    several = rows["num_slots"].nunique() > 1
    for (scheme, _), own in rows.groupby(["scheme", "num_slots"], sort=False):
        lines = own.pivot_table(choice.y, choice.x, "learner")
        episodes = np.unique(own["episode"])
        spacing = float(np.median(np.diff(episodes))) if len(episodes) > 1 else 1.0
        window = max(round(choice.smoothing / spacing), 1)
        smooth = lines.rolling(window, min_periods=1).mean() if window > 1 else lines
        yield Curves(run, str(scheme), int(own["num_slots"].iloc[0]), several, smooth)


def comparison(
    metrics: Mapping[str, pd.DataFrame], optima: Mapping[str, Mapping[str, float]], choice: Choice
) -> go.Figure:
    """The curves of several runs: a thin line for each learner, and their mean.

    A colour stands for a scheme, as everywhere, and a dash pattern for a run, or where there is one
    run, as everywhere, for whether a scheme relays or jams; or, if so chosen, a colour for a run
    and a dash pattern for a scheme.

    Args:
        metrics: by the run's name.
        optima: of the runs for which they are known, by the scheme's rule, in bps/Hz.
        choice: what is drawn.
    """
    figure = go.Figure()
    for index, (run, rows) in enumerate(metrics.items()):
        for curves in curves_of(run, rows, choice):
            line = _line(choice, index, curves.scheme, several_runs=len(metrics) > 1)
            figure.add_traces(list(_traces(curves, line, several_runs=len(metrics) > 1)))
            optimum = optima.get(run, {}).get(curves.scheme)
            if optimum is not None and choice.y in OF_THE_RETURN and not curves.several_horizons:
                label = LABELS[OPTIMA[curves.scheme]]
                figure.add_hline(
                    y=optimum,
                    line={"color": line["color"], "width": 1, "dash": "dot"},
                    name=_lines(f"{label}, {run}" if len(metrics) > 1 else label),
                    showlegend=True,
                )
    named = [trace for trace in figure.data if trace.showlegend is not False]
    figure.update_layout(
        **base_layout(),
        xaxis=axis(X_AXES[choice.x], rangemode="tozero"),
        yaxis=axis(axes_of(metrics).get(choice.y, choice.y)),
        height=min(460 + 20 * max(len(named) - 4, 0), 760),  # a legend takes up to half of it
        margin={"l": 8, "r": 24, "t": 12, "b": 8},
        showlegend=True,
        legend={"orientation": "h", "y": -0.2, "yanchor": "top", "x": 0.0},
        uirevision="-".join(("curves", choice.x, choice.y)),  # a zoom outlives new rows
    )
    return figure


def _line(choice: Choice, run: int, rule: str, *, several_runs: bool) -> dict[str, Any]:
    if choice.color_by == "run":
        dash = SCHEME_DASHES.get(rule, "dashdot")
        return {"color": RUN_COLORS[run % len(RUN_COLORS)], "dash": dash}
    scheme = LEARNED.get(rule, rule)
    dash = DASHES[run % len(DASHES)] if several_runs else scheme_dash(scheme)
    return {"color": scheme_color(scheme), "dash": dash}


def _traces(curves: Curves, line: dict[str, Any], *, several_runs: bool) -> Iterator[go.Scatter]:
    """All learners' lines as one trace, so that hundreds stay responsive, and their mean."""
    label = f"{curves.label}, {curves.run}" if several_runs else curves.label
    x, count = curves.lines.index.to_numpy(dtype=float), curves.lines.shape[1]
    group = f"{curves.run}/{curves.label}"
    if count > 1:
        parts = [
            thinned(x, curves.lines[learner].to_numpy(dtype=float))
            for learner in curves.lines.columns[:MOST_SEEDS]
        ]
        xs, ys = (_with_gaps([part[axis] for part in parts]) for axis in (0, 1))
        style = {"color": line["color"], "width": 0.7}
        yield go.Scatter(
            x=xs,
            y=ys,
            mode="lines",
            line=style,
            opacity=0.35,
            legendgroup=group,
            showlegend=False,
            hoverinfo="skip",
        )
    middle_x, middle_y = thinned(x, curves.middle())
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


def thinned(x: Values, y: Values) -> tuple[Values, Values]:
    """At most :data:`MOST_POINTS` points of a line: the lowest and the highest of each stretch.

    Args:
        x: (n,) in order.
        y: (n,), NaN where there is nothing.
    """
    known = ~np.isnan(y)
    x, y = x[known], y[known]
    if len(x) <= MOST_POINTS:
        return x, y
    stretches = np.array_split(np.arange(len(x)), MOST_POINTS // 2 - 1)
    extremes = [(own[y[own].argmin()], own[y[own].argmax()]) for own in stretches]
    kept = np.unique([0, len(x) - 1, *np.ravel(extremes)])
    return x[kept], y[kept]


def _with_gaps(parts: list[Values]) -> Values:
    """The lines one after the other, with a gap behind each."""
    return np.concatenate([np.append(part, np.nan) for part in parts])
