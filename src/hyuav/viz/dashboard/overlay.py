"""The explorer's map: what a helper position brings, and the flights over it."""

from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import torch
from numpy.typing import NDArray

from hyuav.envs.rendering import HELPER_COLOR
from hyuav.physics.offloading import ModeRule
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Control, Physics, slot
from hyuav.physics.tasks import mean_tasks
from hyuav.viz.data.maps import Mode
from hyuav.viz.html.maps import sum_rate_map
from hyuav.viz.html.style import scheme_color, scheme_label

QUANTITIES = {"rate": "Secrecy sum-rate", "coverage": "UEs that can offload"}
"""What the map can show at each helper position."""

MODES: dict[str, Mode] = {"hybrid": "better", "relay": "relay", "jamming": "jamming"}
"""The helper's mode on the map, by who chooses it."""

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
    resolution = scenario.map_side / POINTS_PER_SIDE
    figure = sum_rate_map(scenario, MODES[rule], resolution)
    if quantity == "coverage":
        counts = offloading_counts(scenario, rule, resolution)
        figure.data[0].update(
            z=counts,
            zmax=scenario.num_ues,
            colorscale="Cividis",
            hovertemplate="helper at (%{x:.0f}, %{y:.0f}) m: %{z} UEs<extra></extra>",
        )
    unit = " (bps/Hz)" if quantity == "rate" else f" (of {scenario.num_ues})"
    figure.data[0].update(colorbar=_colorbar(QUANTITIES[quantity] + unit))
    figure.update_traces(showlegend=False, selector={"type": "contour"})
    figure.update_yaxes(constraintoward="top")  # on a narrow page the square leaves room below
    figure.add_trace(_start(scenario))
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
    for scheme, rows in flights[flights["episode"] == 0].groupby("scheme", sort=False):
        figure.add_traces(list(_flight(scenario, str(scheme), rows)))
    figure.for_each_trace(_stay_bright, selector={"type": "scatter"})
    drawn = figure.data[:map_and_nodes]
    below = [trace for trace in drawn if trace.type != "scatter"]
    above = [trace for trace in drawn if trace.type == "scatter"]
    figure.data = (*below, *figure.data[map_and_nodes:], *above)


def offloading_counts(scenario: Scenario, rule: str, resolution: float) -> NDArray[np.int64]:
    """How many UEs offload at each helper position, without fading: a row per y, a column per x.

    Where the UEs can fill the edge server, their tasks are of mean size.

    Args:
        scenario: to count in.
        rule: who chooses the mode.
        resolution: of the map in m.
    """
    half = scenario.map_side / 2
    across = torch.arange(-half, half + resolution / 2, resolution, dtype=torch.float64)
    physics = Physics(scenario, dtype=torch.float64)
    y, x = torch.meshgrid(across, across, indexing="ij")
    positions = torch.stack([x, y], dim=-1).unsqueeze(-2)
    hovering = Control(torch.zeros_like(positions), ModeRule.of([rule]))
    nodes = physics.nodes._replace(helper=positions)
    over = slot(physics, nodes, hovering, tasks=mean_tasks(scenario, torch.float64))
    return over.offloading.sum(dim=-1).numpy()


def _colorbar(title: str) -> dict[str, Any]:
    above = {"orientation": "h", "x": 0.5, "xanchor": "center", "y": 1.01, "yanchor": "bottom"}
    return {"title": {"text": title, "side": "top"}, "thickness": 12, "len": 0.9, **above}


def _flight(scenario: Scenario, scheme: str, rows: pd.DataFrame) -> Iterator[go.Scatter]:
    """The path on a white ground, a piece for each stretch in one mode."""
    rows = rows.sort_values("slot")
    path = np.vstack([scenario.helper_starts[0], rows[["x", "y"]].to_numpy(dtype=float)])
    label, color = scheme_label(scheme), scheme_color(scheme)
    common = {"legendgroup": label, "hoverinfo": "skip"}
    ground = {"color": "white", "width": 6}
    yield go.Scatter(
        x=path[:, 0],
        y=path[:, 1],
        mode="lines",
        line=ground,
        opacity=0.8,
        showlegend=False,
        **common,
    )
    stretches = groupby(enumerate(rows["relay"].astype(bool)), key=lambda slot: slot[1])
    for number, (relay, slots) in enumerate(stretches):
        flown = [index for index, _ in slots]
        piece = path[flown[0] : flown[-1] + 2]
        yield go.Scatter(
            x=piece[:, 0],
            y=piece[:, 1],
            mode="lines+markers",
            line={"color": color, "width": 3, "dash": "solid" if relay else "6px,4px"},
            marker={"color": color, "size": 5},
            name=label,
            showlegend=number == 0,
            **common,
        )


def _start(scenario: Scenario) -> go.Scatter:
    marker = {"symbol": "diamond", "size": 11, "color": HELPER_COLOR}
    return go.Scatter(
        x=[scenario.helper_starts[0][0]],
        y=[scenario.helper_starts[0][1]],
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
