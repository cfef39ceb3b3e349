"""The player's map: the path flown so far, and what the nodes do in a slot."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hyuav.envs.appearance import (
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
from hyuav.viz.data.flights import Flight, links, names
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
    x, y = _pieces(flight.path.round(2).swapaxes(0, 1).tolist())
    circle = _circle(scenario.legitimate_position, scenario.coverage_radius)
    return [
        _disk(circle, LEGITIMATE_COLOR, "coverage of L"),
        _line(x, y, {"color": "#C8C8C8", "width": 1}, "whole flight"),
    ]


def _pieces(paths: Iterable[Sequence[Sequence[float]]]) -> tuple[list[Any], list[Any]]:
    """Several paths of (x, y) as one line with gaps; :data:`_NOTHING` where there is none."""
    points = [point for path in paths for point in ((None, None), *path)][1:]
    if not points:
        return _NOTHING, _NOTHING
    x, y = zip(*points, strict=True)
    return list(x), list(y)


def moving_on_map(scenario: Scenario, flight: Flight, slot: int, color: str) -> list[Trace]:
    """What a slot changes, always as many traces in the same order."""
    helpers = [(round(x, 2), round(y, 2)) for x, y in flight.helpers(slot + 1)]
    relays = flight.relay[slot]
    circles = [
        list(zip(*_circle(helper, scenario.coverage_radius), strict=True))
        for helper, relay in zip(helpers, relays, strict=True)
        if relay
    ]
    return [
        _disk(_pieces(circles), color, "coverage of H, relaying"),
        *_flown(flight, slot, color),
        *_links(scenario, flight, slot),
        *_ues(scenario, flight, slot, helpers),
        _uavs([scenario.legitimate_position], LEGITIMATE_LABEL, "square", LEGITIMATE_COLOR),
        _uavs(
            scenario.eavesdropper_positions,
            EAVESDROPPER_LABEL,
            "triangle-down",
            EAVESDROPPER_COLOR,
        ),
        _uavs(helpers, HELPER_LABEL, "circle-open", color),
    ]


def _flown(flight: Flight, slot: int, color: str) -> list[Trace]:
    """The path up to the slot, as a line for each mode."""
    paths: dict[bool, list[list[list[float]]]] = {True: [], False: []}
    for helper, path in enumerate(flight.path.round(2).swapaxes(0, 1)):
        for relay, first, last in runs_of_one_mode(flight.relay[: slot + 1, helper]):
            paths[relay].append(path[first : last + 1].tolist())
    lines = []
    for (name, dash), flown in zip(_PATH_DASHES.items(), paths.values(), strict=True):
        style = {"color": color, "width": 2.6, "dash": dash}
        line = _line(*_pieces(flown), style, name, legend=True)
        lines.append(line | {"mode": "lines+markers", "marker": {"size": 4, "color": color}})
    return lines


def _links(scenario: Scenario, flight: Flight, slot: int) -> list[Trace]:
    """The links that are alive: a UE's while it offloads, a helper's in its mode."""
    return [
        _line(*_pieces(ends), style, name, legend=True)
        for (name, style), ends in zip(LINKS.items(), links(scenario, flight, slot), strict=True)
    ]


def _ues(scenario: Scenario, flight: Flight, slot: int, helpers: Sequence[Point]) -> list[Trace]:
    """The UEs, filled where they offload."""
    near_legitimate, near_helpers = _coverage(scenario, helpers)
    called = names("H", len(helpers))
    points = np.array(scenario.ue_positions)
    texts = np.array(
        [
            f"UE {index + 1}, {'offloads' if flight.offloading[slot, index] else 'computes itself'}"
            f"<br>{flight.secrecy_rate[slot, index]:.3f} bps/Hz, "
            f"{1e3 * flight.energy[slot, index]:.2f} mJ"
            f"<br>{'within' if near_legitimate[index] else 'outside'} the coverage of L, "
            + ", ".join(
                f"{'within' if near else 'outside'} that of {name}"
                for near, name in zip(near_helpers[index], called, strict=True)
            )
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


def _coverage(
    scenario: Scenario, helpers: Sequence[Point]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which UEs L covers, (U,), and which each helper would: (U, H), as eq. 5 has it."""
    nodes, radius = Nodes.of(scenario, "cpu"), scenario.coverage_radius
    to_legitimate = horizontal_distance(nodes.ue, nodes.legitimate)
    places = nodes.legitimate.new_tensor(helpers)
    to_helpers = horizontal_distance(nodes.ue.unsqueeze(1), places)
    return covered(to_legitimate, radius).numpy(), covered(to_helpers, radius).numpy()


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


def _uavs(positions: Sequence[Point], label: str, symbol: str, color: str) -> Trace:
    """UAVs of one role, with their letter and number beside them where there are several."""
    x, y = map(list, zip(*positions, strict=True))
    role, _, letter = label.removesuffix(")").partition(" (")
    called = names(letter, len(positions))
    return trace(
        "scatter",
        x=x,
        y=y,
        text=called,
        textposition="top left" if letter == "H" else "bottom right",  # a jammer is near E
        textfont={"size": 11, "color": color, "weight": "bold"},
        name=label,
        mode="markers" if len(positions) == 1 else "markers+text",
        marker={"symbol": symbol, "size": 14, "color": color, "line": {"width": 3, "color": color}},
        hovertemplate=f"{role} (%{{text}})<br>(%{{x:.1f}}, %{{y:.1f}}) m<extra></extra>",
        cliponaxis=False,
    )
