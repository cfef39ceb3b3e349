"""The explorer's map: what a helper position brings, and the flights over it."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from hyuav.envs.appearance import HELPER_COLOR, runs_of_one_mode
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.flights import Flight, first_flights, flying_schemes
from hyuav.viz.data.maps import RULE_MODES, helper_map
from hyuav.viz.data.schemes import scheme_color, scheme_label
from hyuav.viz.html.maps import map_figure
from hyuav.viz.html.style import plain

QUANTITIES = {"rate": "Secrecy sum-rate", "coverage": "UEs that can offload"}
"""What the map can show at each helper position."""

POINTS_PER_SIDE, CLICKS_PER_SIDE = 100, 50
"""Of the map, and of the raster of positions that can be clicked on."""

CLICK_TRACE = "positions to click on"


def explorer_map(scenario: Scenario, rule: str, quantity: str) -> go.Figure:
    """The map of a scenario, any position of which can be clicked on.

    Args:
        scenario: to show.
        rule: who chooses the mode.
        quantity: one of :data:`QUANTITIES`.
    """
    mode, brings = RULE_MODES[rule], helper_map(scenario, scenario.map_side / POINTS_PER_SIDE)
    figure = map_figure(scenario, brings, mode)
    if quantity == "coverage":
        figure.data[0].update(
            z=brings.offloading[mode],
            zmax=scenario.num_ues,
            colorscale="Cividis",
            hovertemplate="helper at (%{x:.0f}, %{y:.0f}) m: %{z} UEs<extra></extra>",
        )
    unit = " (bps/Hz)" if quantity == "rate" else f" (of {scenario.num_ues})"
    if scenario.num_helpers > 1:
        unit = f", one helper alone{unit}"
    figure.data[0].update(colorbar=_colorbar(QUANTITIES[quantity] + unit))
    figure.update_traces(showlegend=False, selector={"type": "contour"})
    figure.update_yaxes(constraintoward="top")  # on a narrow page the square leaves room below
    figure.add_trace(_starts(scenario))
    figure.add_trace(_clickable(scenario))
    figure.for_each_trace(_stay_bright, selector={"type": "scatter"})
    figure.update_layout(
        title=None,
        height=None,  # the page's
        margin={"l": 50, "r": 20, "t": 150, "b": 10},
        showlegend=True,
        legend={"orientation": "h", "yref": "container", "y": 1.0, "yanchor": "top", "x": 0.0},
        clickmode="event+select",
        uirevision="explorer",
    )
    return figure


def add_flights(figure: go.Figure, scenario: Scenario, flights: pd.DataFrame) -> None:
    """Draw the first flight of each scheme over the map: relaying solid, jamming dashed.

    Args:
        figure: of :func:`explorer_map`.
        scenario: that was flown.
        flights: a row per slot, as in :attr:`hyuav.experiments.evaluation.Evaluation.flights`.
    """
    map_and_nodes = len(figure.data)
    for flight in first_flights(scenario, flights, flying_schemes(flights)).values():
        figure.add_traces(list(_flight(flight)))
    figure.for_each_trace(_stay_bright, selector={"type": "scatter"})
    drawn = figure.data[:map_and_nodes]
    below = [trace for trace in drawn if trace.type != "scatter"]
    above = [trace for trace in drawn if trace.type == "scatter"]
    figure.data = (*below, *figure.data[map_and_nodes:], *above)


def _colorbar(title: str) -> dict[str, Any]:
    above = {"orientation": "h", "x": 0.5, "xanchor": "center", "y": 1.01, "yanchor": "bottom"}
    return {"title": {"text": title, "side": "top"}, "thickness": 12, "len": 0.9, **above}


def _flight(flight: Flight) -> Iterator[go.Scatter]:
    """The helpers' paths on a white ground, a piece for each stretch in one mode."""
    label, color = plain(scheme_label(flight.scheme)), scheme_color(flight.scheme)
    common = {"legendgroup": label, "hoverinfo": "skip"}
    for helper, path in enumerate(flight.path.swapaxes(0, 1)):
        yield go.Scatter(
            x=path[:, 0],
            y=path[:, 1],
            mode="lines",
            line={"color": "white", "width": 6},
            opacity=0.8,
            showlegend=False,
            **common,
        )
        for relay, first, last in runs_of_one_mode(flight.relay[:, helper]):
            piece = path[first : last + 1]
            yield go.Scatter(
                x=piece[:, 0],
                y=piece[:, 1],
                mode="lines+markers",
                line={"color": color, "width": 3, "dash": "solid" if relay else "6px,4px"},
                marker={"color": color, "size": 5},
                name=label,
                showlegend=helper == first == 0,
                **common,
            )


def _starts(scenario: Scenario) -> go.Scatter:
    marker = {"symbol": "diamond", "size": 11, "color": HELPER_COLOR}
    x, y = zip(*scenario.helper_starts, strict=True)
    return go.Scatter(
        x=x,
        y=y,
        mode="markers",
        marker=marker | {"line": {"color": "white", "width": 1}},
        name="helper's start",
        hoverinfo="skip",
        cliponaxis=False,
    )


def _clickable(scenario: Scenario) -> go.Scatter:
    """Invisible positions all over the map, since a click on a heatmap tells no position."""
    half = scenario.map_side / 2
    across = np.linspace(-half, half, CLICKS_PER_SIDE + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(across, across))
    return go.Scatter(
        x=x,
        y=y,
        mode="markers",
        marker={"size": 10, "opacity": 0.0},
        name=CLICK_TRACE,
        showlegend=False,
        hovertemplate="(%{x:.0f}, %{y:.0f}) m<extra></extra>",
    )


def _stay_bright(trace: go.Scatter) -> None:
    """A click selects a position, which is not to dim all others."""
    opacity = 0.0 if trace.name == CLICK_TRACE else 1.0
    for state in ("selected", "unselected"):
        trace.update({state: {"marker": {"opacity": opacity}}})
