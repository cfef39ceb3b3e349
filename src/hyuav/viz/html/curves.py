"""Learning curves and the figures of a comparison, as Plotly figures."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from hyuav.experiments.comparison.statistics import learning_curves, performance_profiles
from hyuav.experiments.comparison.tables import label
from hyuav.experiments.intervals import interquartile_band, interquartile_curve
from hyuav.experiments.schemes import LABELS, LEARNED
from hyuav.viz.html.style import (
    DASHES,
    GRID_COLOR,
    OPTIMUM_COLOR,
    axis,
    base_layout,
    plain,
    scheme_color,
    scheme_dash,
    scheme_label,
    translucent,
)
from hyuav.viz.paper.comparison import color, dash
from hyuav.viz.paper.curves import SMOOTHING

MAX_POINTS = 300
"""Of a curve; neighbouring episodes are averaged where there are more."""

QUANTITIES = {
    "accumulated_reward": "Accumulated reward (bps/Hz)",
    "evaluation": "Noise-free accumulated reward (bps/Hz)",
    "best_evaluation": "Best noise-free accumulated reward (bps/Hz)",
}
"""Columns of the metrics that can be drawn, with the title of their axis."""

_ENTRY_DASHES = ("solid", "8px,4px", "2px,3px", "10px,3px,2px,3px", "18px,4px")
_ENTRY_MARKERS = ("circle", "square", "triangle-up", "diamond", "triangle-down")
"""Of :func:`hyuav.viz.paper.comparison.dash`."""

_HORIZON_MARKERS = ("circle", "square", "triangle-up", "diamond")
_MARKERS = 12
"""Of a line, where they tell horizons apart."""

_WIDTH_AND_OPACITY = {"own": (2.2, 1.0), "paper": (1.3, 0.6)}
"""Of the line of what is learned, and of the same by the paper's own algorithm."""


def learning_figure(
    metrics: pd.DataFrame,
    optima: Mapping[str, float] | None = None,
    quantity: str = "accumulated_reward",
) -> go.Figure:
    """What learners earned against the episodes, a color per scheme.

    The line is the interquartile mean over a scheme's learners, each smoothed where it is noisy;
    the band is its 95 % bootstrap interval. A single learner's own curve stands behind as a thin
    line. What is learned by the paper's own algorithm has a thinner, paler line; several horizons
    differ in their markers.

    Args:
        metrics: rows of ``metrics.csv``, whose ``scheme`` is a mode rule as it stands there, or
            a name of :data:`hyuav.experiments.schemes.SCHEMES`. May be empty.
        optima: what the best flight of the scheme earns in bps/Hz, by the same names.
        quantity: a column of :data:`QUANTITIES`.
    """
    figure = go.Figure(layout=base_layout())
    drawn = metrics.dropna(subset=["episode", "learner", "num_slots", quantity])
    named = drawn.assign(scheme=drawn["scheme"].replace(LEARNED))
    order = {name: place for place, name in enumerate(LABELS)}
    pairs = {(str(scheme), float(slots)) for scheme, slots in _pairs(named)}
    horizons = sorted({horizon for _, horizon in pairs})
    for scheme, horizon in sorted(pairs, key=lambda pair: (order.get(pair[0], len(order)), pair)):
        rows = named[(named["scheme"] == scheme) & (named["num_slots"] == horizon)]
        rewards = rows.pivot_table(quantity, "episode", "learner", sort=True)
        text, look = scheme_label(scheme), _look(scheme)
        if len(horizons) > 1:
            text += f", T = {horizon:.0f}"
            symbol = _HORIZON_MARKERS[horizons.index(horizon) % len(_HORIZON_MARKERS)]
            look |= {"mode": "lines+markers"}
            look["marker"] |= {"symbol": symbol, "size": 7, "maxdisplayed": _MARKERS}
        _add_curve(figure, rewards, text, scheme_color(scheme), look, quantity)
    if len(horizons) <= 1:
        drawn_schemes = {scheme for scheme, _ in pairs}
        best = {LEARNED.get(name, name): value for name, value in (optima or {}).items()}
        _add_optima(figure, {name: best[name] for name in best if name in drawn_schemes})
    if not pairs:
        _say(figure, "no episodes yet")
    figure.update_layout(
        height=460,
        margin={"l": 60, "r": 15, "t": 25, "b": 110},
        xaxis=axis("Episode", rangemode="tozero", nticks=8),
        yaxis=axis(QUANTITIES[quantity], nticks=8),
        legend={"orientation": "h", "x": 0, "y": -0.17, "yanchor": "top"},
        hovermode="closest",
    )
    return figure


def _pairs(rows: pd.DataFrame) -> Iterable[tuple[object, float]]:
    return zip(rows["scheme"], rows["num_slots"], strict=True)


def _look(scheme: str) -> dict[str, Any]:
    """A scheme's line, as :meth:`plotly.graph_objects.Figure.add_scatter` takes it."""
    kind = "paper" if scheme.endswith("_paper") else "own"
    hue, (width, opacity) = scheme_color(scheme), _WIDTH_AND_OPACITY[kind]
    line = {"color": hue, "dash": scheme_dash(scheme), "width": width}
    return {"mode": "lines", "marker": {"color": hue}, "line": line, "opacity": opacity}


def _add_curve(
    figure: go.Figure,
    rewards: pd.DataFrame,
    text: str,
    hue: str,
    look: dict[str, Any],
    quantity: str,
) -> None:
    """One scheme's curve from a column per learner and a row per episode."""
    noisy = quantity == "accumulated_reward"
    smooth = _thinned(rewards.rolling(SMOOTHING if noisy else 1, min_periods=1).mean())
    samples, across = smooth.to_numpy(dtype=float), list(smooth.index)
    group: dict[str, Any] = {"legendgroup": text, "hoverinfo": "skip", "showlegend": False}
    if rewards.shape[1] > 1:
        low, high = interquartile_band(samples)
        figure.add_scatter(
            x=[*across, *across[::-1]],
            y=[*low.round(4), *high.round(4)[::-1]],
            mode="none",
            fill="toself",
            fillcolor=translucent(hue, 0.2 * look["opacity"]),
            **group,
        )
    elif noisy:
        raw = _thinned(rewards)
        line = {"color": translucent(hue, 0.25), "width": 0.8}
        figure.add_scatter(
            x=list(raw.index), y=list(raw.iloc[:, 0].round(4)), mode="lines", line=line, **group
        )
    figure.add_scatter(
        x=across,
        y=list(interquartile_curve(samples).round(4)),
        **look | ({} if len(across) > 1 else {"mode": "markers"}),
        name=text,
        legendgroup=text,
        hovertemplate=f"{text}, episode %{{x:.0f}}: %{{y:.2f}} bps/Hz<extra></extra>",
    )


def _thinned(rewards: pd.DataFrame) -> pd.DataFrame:
    """At most :data:`MAX_POINTS` rows, each the mean of neighbours at their last episode."""
    step = math.ceil(len(rewards) / MAX_POINTS)
    if step <= 1:
        return rewards
    groups = np.arange(len(rewards)) // step
    last = rewards.index.to_series().groupby(groups).last()
    return rewards.groupby(groups).mean().set_axis(last.to_numpy())


def _add_optima(figure: go.Figure, optima: Mapping[str, float]) -> None:
    """A dotted line for each scheme's optimum; one legend entry stands for them all."""
    values = {value: scheme for scheme, value in optima.items()}
    for value, scheme in values.items():
        line = {"color": scheme_color(scheme), "width": 1.4, "dash": DASHES["optimum"]}
        figure.add_hline(y=value, line=line)
    if values:
        line = {"color": OPTIMUM_COLOR, "width": 1.4, "dash": DASHES["optimum"]}
        figure.add_scatter(x=[None], y=[None], mode="lines", line=line, name="its optimum")


def _say(figure: go.Figure, text: str) -> None:
    figure.add_annotation(
        text=text, x=0.5, y=0.5, xref="paper", yref="paper", showarrow=False, font={"size": 15}
    )


def comparison_figures(
    results: pd.DataFrame, curves: pd.DataFrame, cells: pd.DataFrame, threshold: float
) -> dict[str, go.Figure]:
    """The figures of a comparison, by their titles.

    Args:
        results: a row per learner, as :class:`.comparison.summary.Summary` holds them.
        curves: a row per evaluation in training, likewise.
        cells: a row per algorithm, scenario, scheme and horizon, likewise.
        threshold: share of the optimum that counts as solved, drawn as a line.
    """
    lowest = max(math.floor(20 * results["fraction"].min()) / 20, 0.0)
    profiles = performance_profiles(results, np.linspace(min(lowest, 0.95), 1.0, 101))
    return {
        "Interquartile means with 95 % intervals": cells_figure(cells, threshold),
        "Interquartile means of the best weights so far, with 95 % intervals": bands_figure(
            learning_curves(curves),
            ("episode", "Training episodes"),
            ("iqm", "Share of the optimum (%)"),
            threshold,
        ),
        "Share of learners that reach a share of the optimum, with 95 % intervals": bands_figure(
            profiles,
            ("fraction", "Share of the optimum, τ (%)"),
            ("share", "Learners that reach τ (%)"),
            threshold,
        ),
    }


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
        own, hue, text = cells[chosen], color(str(algorithm)), plain(label(str(algorithm)))
        shift = ((len(algorithms) - 1) / 2 - place) * 0.8 / len(algorithms)
        y = [len(rows) - 1 - rows.index(name) + shift for name in np.array(names)[chosen]]
        worst = {"symbol": "line-ns", "size": 10, "line": {"color": hue, "width": 1.6}}
        figure.add_scatter(
            x=(100 * own["worst"]).tolist(),
            y=y,
            mode="markers",
            marker=worst,
            legendgroup=text,
            showlegend=False,
            hovertemplate=f"{text}, worst: %{{x:.1f}} %<extra></extra>",
        )
        figure.add_scatter(
            x=(100 * own["iqm"]).tolist(),
            y=y,
            error_x={
                "array": (100 * (own["high"] - own["iqm"])).tolist(),
                "arrayminus": (100 * (own["iqm"] - own["low"])).tolist(),
                "width": 0,
                "thickness": 2,
            },
            mode="markers",
            marker={"color": hue, "size": 7, "symbol": _ENTRY_MARKERS[dash(str(algorithm))]},
            name=text,
            legendgroup=text,
            hovertemplate=f"{text}: %{{x:.1f}} %<extra></extra>",
        )
    tick = {"symbol": "line-ns", "size": 10, "line": {"color": OPTIMUM_COLOR, "width": 1.6}}
    figure.add_scatter(x=[None], y=[None], mode="markers", marker=tick, name="worst learner")
    for boundary in range(len(rows) - 1):
        figure.add_hline(y=boundary + 0.5, line={"color": GRID_COLOR, "width": 1})
    line = {"color": OPTIMUM_COLOR, "width": 1.2, "dash": DASHES["optimum"]}
    figure.add_vline(x=100 * threshold, line=line)
    height, below = 26 + 9 * len(algorithms), _legend_height(len(algorithms) + 1)
    figure.update_layout(
        height=60 + below + len(rows) * height,
        margin={"l": 110, "r": 20, "t": 20, "b": below},
        xaxis=axis("Share of the optimum (%)", nticks=7),
        yaxis=axis("", range=[-0.5, len(rows) - 0.5], showgrid=False)
        | {"tickvals": list(range(len(rows))), "ticktext": rows[::-1]},
        legend=_legend_below(),
    )
    return figure


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
        hue, text = color(str(algorithm)), plain(label(str(algorithm)))
        across = (scale * own[x[0]]).tolist()
        figure.add_scatter(
            x=[*across, *across[::-1]],
            y=[*(100 * own["low"]), *(100 * own["high"])[::-1]],
            mode="none",
            fill="toself",
            fillcolor=translucent(hue, 0.2),
            legendgroup=text,
            hoverinfo="skip",
            showlegend=False,
        )
        figure.add_scatter(
            x=across,
            y=(100 * own[y[0]]).tolist(),
            mode="lines",
            line={"color": hue, "width": 2.2, "dash": _ENTRY_DASHES[dash(str(algorithm))]},
            name=text,
            legendgroup=text,
            hovertemplate=f"{text}, %{{x:.4g}}: %{{y:.1f}} %<extra></extra>",
        )
    line = {"color": OPTIMUM_COLOR, "width": 1.2, "dash": DASHES["optimum"]}
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
        legend=_legend_below(),
    )
    return figure


def _legend_height(entries: int) -> int:
    """Pixels below a plot for its axis title and a legend of four entries in a row."""
    return 80 + 20 * math.ceil(entries / 4)


def _legend_below() -> dict[str, Any]:
    """60 pixels below the plot whatever its height, as the axis titles need that much."""
    return {"orientation": "h", "x": 0, "yref": "container", "y": 0.01, "yanchor": "bottom"}
