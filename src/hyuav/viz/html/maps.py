"""Maps of the secrecy sum-rate over the helper's positions, as Plotly figures."""

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from hyuav.envs.appearance import (
    EAVESDROPPER_COLOR,
    EAVESDROPPER_LABEL,
    LEGITIMATE_COLOR,
    LEGITIMATE_LABEL,
)
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.maps import HelperMap, Mode, helper_map
from hyuav.viz.html.style import base_layout, square_map, translucent

TITLES: dict[Mode, str] = {"relay": "Relay", "jamming": "Jamming", "better": "Better mode"}


def sum_rate_map(scenario: Scenario, mode: Mode = "better", resolution: float = 2.0) -> go.Figure:
    """The secrecy sum-rate at every helper position, without fading.

    The scale is the same in every mode. On the map of the better mode, a white line goes around
    where relaying is better, and a dashed one around where jamming is: where both regions meet,
    the solid one lies above.

    Args:
        scenario: whose map is drawn.
        mode: of the helper.
        resolution: of the map in m.
    """
    return map_figure(scenario, helper_map(scenario, resolution), mode)


def map_figure(scenario: Scenario, brings: HelperMap, mode: Mode) -> go.Figure:
    """What :func:`sum_rate_map` draws, of a map that is computed already."""
    axis, rates = brings.axis, brings.rates
    of_one = " of one helper alone" if scenario.num_helpers > 1 else ""
    alone = f"without a helper {brings.without_helper:.2f}"
    figure = go.Figure(layout=base_layout())
    figure.add_heatmap(
        x=axis,
        y=axis,
        z=rates[mode].astype(np.float32),
        zmin=0.0,
        zmax=max(float(rates["better"].max()), 1e-6),
        colorscale="Viridis",
        colorbar={
            "title": {"text": f"Secrecy sum-rate (bps/Hz){of_one}<br>{alone}", "side": "bottom"},
            "orientation": "h",
            "thickness": 12,
            "y": -0.16,
            "yanchor": "top",
        },
        hovertemplate="helper at (%{x:.0f}, %{y:.0f}) m: %{z:.2f} bps/Hz<extra></extra>",
    )
    if mode == "better":
        _outline(figure, axis, rates["jamming"] > rates["relay"], "dash")
        _outline(figure, axis, rates["relay"] > rates["jamming"], "solid")
    _add_nodes(figure, scenario)
    figure.update_layout(
        title={"text": TITLES[mode], "x": 0.5, "xanchor": "center", "font": {"size": 14}},
        height=495,
        margin={"l": 50, "r": 15, "t": 35, "b": 140},
        showlegend=False,
        **square_map(scenario.map_side / 2),
    )
    return figure


def _outline(
    figure: go.Figure, axis: NDArray[np.float64], region: NDArray[np.bool_], dash: str
) -> None:
    """A line around a region of the map; nothing where there is none."""
    if region.any():
        figure.add_contour(
            x=axis,
            y=axis,
            z=region.astype(np.float32),
            contours={"start": 0.5, "end": 0.5, "size": 1, "coloring": "none"},
            line={"color": "white", "width": 1.5, "dash": dash},
            showscale=False,
            hoverinfo="skip",
        )


def _add_nodes(figure: go.Figure, scenario: Scenario) -> None:
    (left, bottom), radius = scenario.legitimate_position, scenario.coverage_radius
    figure.add_shape(
        type="circle",
        x0=left - radius,
        x1=left + radius,
        y0=bottom - radius,
        y1=bottom + radius,
        line={"color": translucent("#FFFFFF", 0.8), "width": 1, "dash": "dot"},
    )
    for name, places, size, symbol, color in (
        ("UE", scenario.ue_positions, 6, None, "#000000"),
        (LEGITIMATE_LABEL, [scenario.legitimate_position], 13, "square", LEGITIMATE_COLOR),
        (
            *(EAVESDROPPER_LABEL, scenario.eavesdropper_positions),
            *(13, "triangle-down", EAVESDROPPER_COLOR),
        ),
    ):
        x, y = zip(*places, strict=True)
        edge = {"color": "white", "width": 1}
        figure.add_scatter(
            x=x,
            y=y,
            name=name,
            mode="markers",
            marker={"size": size, "symbol": symbol, "color": color, "line": edge},
            hovertemplate=f"{name}<br>(%{{x:.0f}}, %{{y:.0f}}) m<extra></extra>",
            cliponaxis=False,
        )
