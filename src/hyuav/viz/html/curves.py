"""Learning curves as Plotly figures."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pandas as pd
import plotly.graph_objects as go

from hyuav.experiments.schemes import LEARNED_AS_IN_PAPER, NO_HELPER
from hyuav.viz.data.curves import (
    BPS,
    NOISY,
    SMOOTHING,
    LearningCurve,
    axis_title,
    learning_curves,
)
from hyuav.viz.data.schemes import (
    GREY,
    is_apart,
    mode_rule,
    scheme_color,
    scheme_label,
    scheme_line,
)
from hyuav.viz.html.style import DASHES, axis, base_layout, legend_below, plain, translucent

MAX_POINTS = 300
"""Of a curve; neighbouring episodes are averaged where there are more."""

QUANTITIES = NOISY, "evaluation", "best_evaluation"
"""Columns of the metrics that are drawn."""

_HORIZON_MARKERS = ("circle", "square", "triangle-up", "diamond")
_MARKERS = 12
"""Of a line, where they tell horizons apart."""


def learning_figure(
    metrics: pd.DataFrame,
    references: Mapping[str, float] | None = None,
    quantity: str = NOISY,
    unit: str = BPS,
) -> go.Figure:
    """What learners earned against the episodes, a color per scheme.

    The line is the interquartile mean over a scheme's learners, each smoothed where it is noisy;
    the band is its 95 % bootstrap interval. A single learner's own curve stands behind as a thin
    line. What is learned by the paper's own algorithm has a thinner, paler line; several horizons
    differ in their markers.

    Args:
        metrics: rows of ``metrics.csv``, whose ``scheme`` is a mode rule as it stands there, or
            a name of :data:`hyuav.experiments.schemes.LABELS`. May be empty.
        references: as :func:`.references_of`. What comes without a helper is a line, or where it
            would squash the curves, a number.
        quantity: a column of :data:`QUANTITIES`.
        unit: of the reward.
    """
    figure = go.Figure(layout=base_layout())
    curves = sorted(learning_curves(metrics, quantity), key=lambda curve: curve.place)
    horizons = sorted({curve.num_slots for curve in curves})
    for curve in curves:
        text, look = plain(scheme_label(curve.scheme)), _look(curve.scheme)
        if len(horizons) > 1:
            text += f", T = {curve.num_slots}"
            symbol = _HORIZON_MARKERS[horizons.index(curve.num_slots) % len(_HORIZON_MARKERS)]
            look |= {"mode": "lines+markers"}
            look["marker"] |= {"symbol": symbol, "size": 7, "maxdisplayed": _MARKERS}
        _add_curve(figure, curve, text, look, plain(unit), noisy=quantity == NOISY)
    if len(horizons) <= 1:
        _add_optima(figure, curves, references or {})
        add_no_helper(figure, references or {})
    if not curves:
        font, middle = {"size": 15}, {"xref": "paper", "x": 0.5, "yref": "paper", "y": 0.5}
        figure.add_annotation(text="no episodes yet", showarrow=False, font=font, **middle)
    figure.update_layout(
        height=460,
        margin={"l": 60, "r": 15, "t": 25, "b": 110},
        xaxis=axis("Episode", rangemode="tozero", nticks=8),
        yaxis=axis(plain(axis_title(quantity, unit)), nticks=8),
        legend=legend_below(y=-0.17),
        hovermode="closest",
    )
    return figure


def _look(scheme: str) -> dict[str, Any]:
    """A scheme's line, as :meth:`plotly.graph_objects.Figure.add_scatter` takes it."""
    hue = scheme_color(scheme)
    width, opacity = (1.3, 0.6) if scheme in LEARNED_AS_IN_PAPER.values() else (2.2, 1.0)
    line = {"color": hue, "dash": DASHES[scheme_line(scheme)], "width": width}
    return {"mode": "lines", "marker": {"color": hue}, "line": line, "opacity": opacity}


def _add_curve(
    figure: go.Figure,
    curve: LearningCurve,
    text: str,
    look: dict[str, Any],
    unit: str,
    *,
    noisy: bool,
) -> None:
    smooth = (curve.smoothed(SMOOTHING) if noisy else curve).thinned(MAX_POINTS)
    across, hue = list(smooth.learners.index), look["line"]["color"]
    if curve.learners.shape[1] > 1:
        low, high = (list(bound.round(4)) for bound in smooth.band())
        add_band(figure, across, low, high, translucent(hue, 0.2 * look["opacity"]), text)
    elif noisy:
        raw = curve.thinned(MAX_POINTS).learners
        figure.add_scatter(
            x=list(raw.index),
            y=list(raw.iloc[:, 0].round(4)),
            mode="lines",
            line={"color": translucent(hue, 0.25), "width": 0.8},
            legendgroup=text,
            hoverinfo="skip",
            showlegend=False,
        )
    figure.add_scatter(
        x=across,
        y=list(smooth.middle().round(4)),
        **look | ({} if len(across) > 1 else {"mode": "markers"}),
        name=text,
        legendgroup=text,
        hovertemplate=f"{text}, episode %{{x:.0f}}: %{{y:.2f}} {unit}<extra></extra>",
    )


def add_band(
    figure: go.Figure,
    x: Sequence[Any],
    low: Sequence[Any],
    high: Sequence[Any],
    color: str,
    group: str,
) -> None:
    """Fill the area between two lines, which comes and goes with its group of the legend."""
    figure.add_scatter(
        x=[*x, *x[::-1]],
        y=[*low, *high[::-1]],
        mode="none",
        fill="toself",
        fillcolor=color,
        legendgroup=group,
        hoverinfo="skip",
        showlegend=False,
    )


def _add_optima(
    figure: go.Figure, curves: Sequence[LearningCurve], references: Mapping[str, float]
) -> None:
    """A dotted line for each curve's optimum; one legend entry stands for them all."""
    rules = {curve.scheme: mode_rule(curve.scheme) for curve in curves}
    values = {references[rule]: scheme for scheme, rule in rules.items() if rule in references}
    for value, scheme in values.items():
        line = {"color": scheme_color(scheme), "width": 1.4, "dash": DASHES["dotted"]}
        figure.add_hline(y=value, line=line)
    if values:
        line = {"color": GREY, "width": 1.4, "dash": DASHES["dotted"]}
        figure.add_scatter(x=[None], y=[None], mode="lines", line=line, name="its optimum")


def add_no_helper(
    figure: go.Figure,
    references: Mapping[str, float],
    behind: str = "",
    text: Callable[[str], str] = plain,
) -> None:
    """Set what comes without a helper beside the curves: a line, or a number in the legend.

    Args:
        figure: of the curves.
        references: as :func:`.references_of`.
        behind: the label, in the legend.
        text: writes the label as HTML.
    """
    value = references.get(NO_HELPER)
    if value is None:
        return
    drawn = [height for own in figure.data for height in own.y if height is not None]
    highest = max((float(height) for height in drawn if height == height), default=value)
    label, line = f"{scheme_label(NO_HELPER)}{behind}", {"color": scheme_color(NO_HELPER)}
    if is_apart(value, highest):
        label, invisible = f"{label}: {value:.4g}", {"color": "rgba(0, 0, 0, 0)"}
        figure.add_scatter(x=[None], y=[None], mode="lines", line=invisible, name=text(label))
    else:
        figure.add_hline(y=value, line=line | {"width": 1.4}, name=text(label), showlegend=True)
