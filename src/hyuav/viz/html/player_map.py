"""The player's map: the path flown so far, and what the nodes do in a slot."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hyuav.envs.rendering import (
    EAVESDROPPER_COLOR,
    EAVESDROPPER_LABEL,
    HELPER_LABEL,
    LEGITIMATE_COLOR,
    LEGITIMATE_LABEL,
    OKABE_ITO,
    runs_of_one_mode,
)
from hyuav.physics.channel import horizontal_distance
from hyuav.physics.layout import Nodes
from hyuav.physics.offloading import covered
from hyuav.physics.scenario import Point, Scenario
from hyuav.viz.data.flights import Flight
from hyuav.viz.html.style import translucent

Trace = dict[str, Any]
"""A trace in plain values, which Plotly checks once, with the figure."""

LINKS = {
    "UE → L": {"color": OKABE_ITO["blue"], "width": 1.2},
    "UE → H": {"color": "#7A7A7A", "width": 1.2},
    "H → L, relays": {"color": OKABE_ITO["black"], "width": 2.5},
    "H → E, jams": {"color": OKABE_ITO["reddish purple"], "width": 2.5, "dash": "6px,4px"},
}
"""The lines of the links that are alive in a slot."""

_PATH_DASHES = {"flown relaying": "solid", "flown jamming": "6px,4px"}
_NOTHING: list[float | None] = [None]


def trace(kind: str, **values: Any) -> Trace:
    """A trace of a kind that Plotly knows."""
    return {"type": kind, **values}


def fixed_on_map(scenario: Scenario, flight: Flight) -> list[Trace]:
    """What stays from slot to slot."""
    x, y = flight.path.round(2).T.tolist()
    circle = _circle(scenario.legitimate_position, scenario.coverage_radius)
    return [
        _disk(circle, LEGITIMATE_COLOR, "coverage of L"),
        _line(x, y, {"color": "#C8C8C8", "width": 1}, "whole flight"),
    ]


def moving_on_map(scenario: Scenario, flight: Flight, slot: int, color: str) -> list[Trace]:
    """What a slot changes, always as many traces in the same order."""
    x, y = flight.helper(slot + 1)
    helper = round(x, 2), round(y, 2)
    relay = bool(flight.relay[slot])
    near = _circle(helper, scenario.coverage_radius) if relay else (_NOTHING, _NOTHING)
    return [
        _disk(near, color, "coverage of H, relaying"),
        *_flown(flight, slot, color),
        *_links(scenario, flight.offloading[slot], helper, relay=relay),
        *_ues(scenario, flight, slot, helper),
        _uav(scenario.legitimate_position, LEGITIMATE_LABEL, "square", LEGITIMATE_COLOR),
        _uav(
            scenario.eavesdropper_positions[0],
            EAVESDROPPER_LABEL,
            "triangle-down",
            EAVESDROPPER_COLOR,
        ),
        _uav(helper, HELPER_LABEL, "circle-open", color),
    ]


def _flown(flight: Flight, slot: int, color: str) -> list[Trace]:
    """The path up to the slot, as a line for each mode."""
    coordinates: dict[bool, list[tuple[float | None, float | None]]] = {True: [], False: []}
    path = flight.path.round(2)
    for relay, first, last in runs_of_one_mode(flight.relay[: slot + 1]):
        coordinates[relay] += [(None, None), *map(tuple, path[first : last + 1].tolist())]
    lines = []
    for (name, dash), flown in zip(_PATH_DASHES.items(), coordinates.values(), strict=True):
        x, y = zip(*flown, strict=True) if flown else (_NOTHING, _NOTHING)
        style = {"color": color, "width": 2.6, "dash": dash}
        line = _line(list(x), list(y), style, name, legend=True)
        lines.append(line | {"mode": "lines+markers", "marker": {"size": 4, "color": color}})
    return lines


def _links(
    scenario: Scenario, offloading: NDArray[np.bool_], helper: Point, *, relay: bool
) -> list[Trace]:
    """The links that are alive: a UE's while it offloads, the helper's in its mode."""
    senders = [ue for ue, sends in zip(scenario.ue_positions, offloading, strict=True) if sends]
    legitimate, eavesdropper = scenario.legitimate_position, scenario.eavesdropper_positions[0]
    alive = {
        "UE → L": [(ue, legitimate) for ue in senders],
        "UE → H": [(ue, helper) for ue in senders if relay],
        "H → L, relays": [(helper, legitimate)] if relay and senders else [],
        "H → E, jams": [] if relay else [(helper, eavesdropper)],
    }
    lines = []
    for name, ends in alive.items():
        x = [value for first, last in ends for value in (first[0], last[0], None)]
        y = [value for first, last in ends for value in (first[1], last[1], None)]
        lines.append(_line(x or _NOTHING, y or _NOTHING, LINKS[name], name, legend=True))
    return lines


def _ues(scenario: Scenario, flight: Flight, slot: int, helper: Point) -> list[Trace]:
    """The UEs, filled where they offload."""
    near_legitimate, near_helper = _coverage(scenario, helper)
    points = np.array(scenario.ue_positions)
    texts = np.array(
        [
            f"UE {index + 1}, {'offloads' if flight.offloading[slot, index] else 'computes itself'}"
            f"<br>{flight.secrecy_rate[slot, index]:.3f} bps/Hz, "
            f"{1e3 * flight.energy[slot, index]:.2f} mJ"
            f"<br>{'within' if near_legitimate[index] else 'outside'} the coverage of L, "
            f"{'within' if near_helper[index] else 'outside'} that of H"
            for index in range(scenario.num_ues)
        ]
    )
    traces = []
    for chosen, face, name in (
        (flight.offloading[slot], "#000000", "UE, offloads"),
        (~flight.offloading[slot], "#FFFFFF", "UE, computes itself"),
    ):
        some = bool(chosen.any())
        traces.append(
            trace(
                "scatter",
                x=points[chosen, 0].tolist() if some else _NOTHING,
                y=points[chosen, 1].tolist() if some else _NOTHING,
                text=texts[chosen].tolist() if some else [""],
                name=name,
                mode="markers",
                marker={"size": 8, "color": face, "line": {"color": "#000000", "width": 1.3}},
                hovertemplate="%{text}<extra></extra>",
            )
        )
    return traces


def _coverage(scenario: Scenario, helper: Point) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which UEs eq. 5 lets jam, and which it lets relay, were the helper there: (U,) each."""
    nodes, radius = Nodes.of(scenario, "cpu"), scenario.coverage_radius
    to_legitimate = horizontal_distance(nodes.ue, nodes.legitimate)
    to_helper = horizontal_distance(nodes.ue, nodes.legitimate.new_tensor(helper))
    return covered(to_legitimate, radius).numpy(), covered(to_helper, radius).numpy()


def _circle(center: Point, radius: float) -> tuple[list[float], list[float]]:
    angles = np.linspace(0.0, 2.0 * np.pi, 61)
    x, y = center[0] + radius * np.cos(angles), center[1] + radius * np.sin(angles)
    return x.round(1).tolist(), y.round(1).tolist()


def _disk(points: tuple[Any, Any], color: str, name: str) -> Trace:
    line = {"color": translucent(color, 0.6), "width": 1}
    return _line(*points, line, name) | {"fill": "toself", "fillcolor": translucent(color, 0.08)}


def _line(x: Any, y: Any, style: dict[str, Any], name: str, *, legend: bool = False) -> Trace:
    return trace(
        "scatter",
        x=x,
        y=y,
        name=name,
        mode="lines",
        line=style,
        showlegend=legend,
        hoverinfo="skip",
    )


def _uav(position: Point, name: str, symbol: str, color: str) -> Trace:
    return trace(
        "scatter",
        x=[position[0]],
        y=[position[1]],
        name=name,
        mode="markers",
        marker={"symbol": symbol, "size": 14, "color": color, "line": {"width": 3, "color": color}},
        hovertemplate=f"{name}<br>(%{{x:.1f}}, %{{y:.1f}}) m<extra></extra>",
        cliponaxis=False,
    )
