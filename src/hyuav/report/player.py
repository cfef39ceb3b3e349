"""The flight player: a map with a slot slider, and each slot's links, rates and energies."""

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import torch
from numpy.typing import NDArray

from hyuav.envs.rendering import EAVESDROPPER_COLOR, LEGITIMATE_COLOR, OKABE_ITO
from hyuav.errors import InputError, rejection
from hyuav.model.channel import horizontal_distance
from hyuav.model.offloading import covered_by_legitimate, covered_by_relay
from hyuav.report.player_layout import animation_controls, layouts
from hyuav.report.style import base_layout, scheme_color, scheme_label, translucent
from hyuav.scenario import Point, Scenario

LINKS = {
    "UE → L": {"color": OKABE_ITO["blue"], "width": 1.2},
    "UE → H": {"color": "#7A7A7A", "width": 1.2},
    "H → L, relays": {"color": OKABE_ITO["black"], "width": 2.5},
    "H → E, jams": {"color": OKABE_ITO["reddish purple"], "width": 2.5, "dash": "6px,4px"},
}
"""The lines of the links that are alive in a slot."""

_PATH_DASHES = {"flown relaying": "solid", "flown jamming": "6px,4px"}
Trace = dict[str, Any]
"""A trace in plain values, which Plotly checks once, with the figure."""

_NOTHING: list[float | None] = [None]
_LABELLED_UES = 24
"""Beyond this many UEs, the bars are too narrow for their values."""


class _Flight(NamedTuple):
    """One flight slot by slot; T slots, U UEs."""

    path: NDArray[np.float64]
    """The start and the position in each slot: (T + 1, 2) m."""
    relay: NDArray[np.bool_]
    """(T,)"""
    offloading: NDArray[np.bool_]
    """(T, U)"""
    secrecy_rate: NDArray[np.float64]
    """(T, U) bps/Hz."""
    energy: NDArray[np.float64]
    """Of the UEs, L and H: (T, U + 2) J."""
    rows: pd.DataFrame


def flight_player(
    scenario: Scenario,
    flights: pd.DataFrame,
    scheme: str,
    episode: int = 0,
    *,
    narrow: bool = False,
) -> go.Figure:
    """A flight slot by slot, moved by a slider or played.

    The map shows the path flown so far (relaying solid, jamming dashed), which UEs offload
    (filled), the links that are alive and the coverage that counts; beside it stand the slot's
    secrecy rates, its energies as shares of the budgets, and the sum-rates of all slots.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`hyuav.evaluation.Evaluation.flights`.
        scheme: whose flight is shown.
        episode: which of its flights.
        narrow: whether the panels stand below the map, as for a phone, and not beside it. The
            figure's ``layout.meta`` holds what to change for ``wide`` and ``narrow``.

    Raises:
        InputError: there is no such flight, or it is not one of this scenario.
    """
    flight = _flight(scenario, flights, scheme, episode)
    color, num_slots = scheme_color(scheme), len(flight.relay)
    moving = [_moving(scenario, flight, slot, color) for slot in range(num_slots)]
    fixed = _fixed(scenario, flight)
    titles = [_title(scheme, flight, slot) for slot in range(num_slots)]
    both = layouts(scenario, num_slots, _highest(flight))
    figure = go.Figure(
        data=[*fixed, *moving[0]],
        frames=[
            {
                "name": str(slot + 1),
                "data": moving[slot],
                "traces": list(range(len(fixed), len(fixed) + len(moving[slot]))),
                "layout": {"title": {"text": titles[slot]}},
            }
            for slot in range(num_slots)
        ],
        layout=base_layout() | {"title": {"text": titles[0]}},
    )
    figure.update_layout(animation_controls(num_slots))
    figure.update_layout(both["shared"])
    figure.update_layout(both["narrow" if narrow else "wide"])
    figure.update_layout(meta={name: both[name] for name in ("wide", "narrow")})
    return figure


def _flight(scenario: Scenario, flights: pd.DataFrame, scheme: str, episode: int) -> _Flight:
    chosen = (flights["scheme"] == scheme) & (flights["episode"] == episode)
    rows = flights[chosen].sort_values("slot")
    if not len(rows):
        known = ", ".join(dict.fromkeys(f"{s} {e}" for s, e in _pairs(flights))) or "none"
        accepted = f"a scheme and episode of the flights: {known}"
        raise InputError(rejection("flight", f"{scheme} {episode}", accepted))
    lists = {name: list(rows[name]) for name in ("offloading", "secrecy_rate", "ue_energy")}
    if any(len(entry) != scenario.num_ues for values in lists.values() for entry in values):
        accepted = f"lists with an entry for each of the scenario's {scenario.num_ues} UEs"
        raise InputError(rejection("flights", f"{scheme} {episode}", accepted))
    others = rows[["edge_energy", "helper_energy"]].to_numpy(float)
    return _Flight(
        np.vstack([scenario.helper_start, rows[["x", "y"]].to_numpy(float)]).round(2),
        rows["relay"].to_numpy(bool),
        np.array(lists["offloading"], dtype=bool),
        np.array(lists["secrecy_rate"], dtype=float),
        np.hstack([np.array(lists["ue_energy"], dtype=float), others]),
        rows,
    )


def _pairs(flights: pd.DataFrame) -> list[tuple[str, int]]:
    return list(zip(flights["scheme"], flights["episode"], strict=True))


def _highest(flight: _Flight) -> list[float]:
    """Of the secrecy rates, and of the sum-rates, in bps/Hz."""
    columns = ["secrecy_sum_rate", "relay_sum_rate", "jamming_sum_rate"]
    return [float(flight.secrecy_rate.max()), float(flight.rows[columns].to_numpy(float).max())]


def _title(scheme: str, flight: _Flight, slot: int) -> str:
    """What a person reads of the slot, on two lines."""
    row, relay = flight.rows.iloc[slot], flight.relay[slot]
    count, total = int(flight.offloading[slot].sum()), flight.offloading.shape[1]
    mode = "relay" if relay else "jamming"
    off_map = ", turned back at the edge" if row["off_map"] else ""
    return (
        f"<b>{scheme_label(scheme)}, slot {slot + 1} of {len(flight.relay)}: {mode}</b>{off_map}"
        f"<br>{count} of {total} UEs offload, {row['secrecy_sum_rate']:.2f} bps/Hz"
    )


def _fixed(scenario: Scenario, flight: _Flight) -> list[Trace]:
    """What stays from slot to slot."""
    slots = list(range(1, len(flight.relay) + 1))
    x, y = flight.path.T.tolist()
    circle = _circle(scenario.legitimate_position, scenario.coverage_radius)
    rates = flight.rows[["relay_sum_rate", "jamming_sum_rate"]].to_numpy(float).round(4)
    return [
        _disk(circle, LEGITIMATE_COLOR, "coverage of L"),
        _line(x, y, {"color": "#C8C8C8", "width": 1}, "whole flight"),
        *(
            _trace(
                "scatter",
                x=slots,
                y=rates[:, column].tolist(),
                name=name,
                mode="lines",
                line={"color": "#8A8A8A", "width": 1.2, "dash": dash},
                showlegend=False,
                hovertemplate=f"slot %{{x}}: %{{y:.2f}} bps/Hz if {name}<extra></extra>",
                xaxis="x4",
                yaxis="y4",
            )
            for column, (name, dash) in enumerate((("relaying", "solid"), ("jamming", "6px,4px")))
        ),
    ]


def _moving(scenario: Scenario, flight: _Flight, slot: int, color: str) -> list[Trace]:
    """What a slot changes, always as many traces in the same order."""
    helper = (float(flight.path[slot + 1, 0]), float(flight.path[slot + 1, 1]))
    relay = bool(flight.relay[slot])
    near = _circle(helper, scenario.coverage_radius) if relay else (_NOTHING, _NOTHING)
    return [
        _disk(near, color, "coverage of H, relaying"),
        *_flown(flight, slot, color),
        *_links(scenario, flight.offloading[slot], helper, relay=relay),
        *_ues(scenario, flight, slot, helper),
        _uav(scenario.legitimate_position, "legitimate UAV (L)", "square", LEGITIMATE_COLOR),
        _uav(
            scenario.eavesdropper_position, "eavesdropper (E)", "triangle-down", EAVESDROPPER_COLOR
        ),
        _uav(helper, "helper UAV (H)", "circle-open", color),
        *_bars(scenario, flight, slot, color),
        *_sum_rates(flight, slot, color),
    ]


def _flown(flight: _Flight, slot: int, color: str) -> list[Trace]:
    """The path up to the slot, as a line for each mode."""
    lines = []
    for (name, dash), mode in zip(_PATH_DASHES.items(), (True, False), strict=True):
        x: list[float | None] = []
        y: list[float | None] = []
        for own in np.flatnonzero(flight.relay[: slot + 1] == mode).tolist():
            first, last = flight.path[own], flight.path[own + 1]
            if x and flight.relay[own - 1] == mode:
                x.append(last[0])
                y.append(last[1])
            else:
                x += [None, first[0], last[0]]
                y += [None, first[1], last[1]]
        style = {"color": color, "width": 2.6, "dash": dash}
        line = _line(x or _NOTHING, y or _NOTHING, style, name, legend=True)
        lines.append(line | {"mode": "lines+markers", "marker": {"size": 4, "color": color}})
    return lines


def _links(
    scenario: Scenario, offloading: NDArray[np.bool_], helper: Point, *, relay: bool
) -> list[Trace]:
    """The links that are alive: a UE's while it offloads, the helper's in its mode."""
    senders = [ue for ue, sends in zip(scenario.ue_positions, offloading, strict=True) if sends]
    legitimate, eavesdropper = scenario.legitimate_position, scenario.eavesdropper_position
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


def _ues(scenario: Scenario, flight: _Flight, slot: int, helper: Point) -> list[Trace]:
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
            _trace(
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
    ues, radius = torch.tensor(scenario.ue_positions), scenario.coverage_radius
    to_legitimate = horizontal_distance(ues, torch.tensor(scenario.legitimate_position))
    to_helper = horizontal_distance(ues, torch.tensor(helper))
    anywhere = torch.zeros_like(to_legitimate)
    return (
        covered_by_legitimate(to_legitimate, radius).numpy(),
        covered_by_relay(to_helper, anywhere, radius).numpy(),
    )


def _bars(scenario: Scenario, flight: _Flight, slot: int, color: str) -> list[Trace]:
    """The slot's secrecy rates, and its energies as shares of the budgets."""
    ues = [str(index + 1) for index in range(scenario.num_ues)]
    budgets = np.array(
        [scenario.ue_energy_budget] * len(ues)
        + [scenario.edge_energy_budget, scenario.helper_energy_budget]
    )
    spent, rates = flight.energy[slot], flight.secrecy_rate[slot].round(4)
    shares = 100 * np.divide(spent, budgets, out=np.zeros_like(spent), where=budgets > 0)
    units = np.array([1e3] * len(ues) + [1.0, 1.0])
    told = [
        f"{unit * value:.4g} of {unit * budget:g} {'J' if unit == 1 else 'mJ'}"
        for value, budget, unit in zip(spent, budgets, units, strict=True)
    ]
    labelled = scenario.num_ues <= _LABELLED_UES
    label_style = {"textposition": "outside", "cliponaxis": False, "constraintext": "none"}
    label_style |= {"textangle": 0, "textfont": {"size": 9}}
    return [
        _trace(
            "bar",
            x=ues,
            y=rates.tolist(),
            name="secrecy rate",
            marker={"color": color},
            showlegend=False,
            text=[f"{rate:.2f}" if rate else "" for rate in rates] if labelled else None,
            hovertemplate="UE %{x}: %{y:.3f} bps/Hz<extra></extra>",
            xaxis="x2",
            yaxis="y2",
            **label_style,
        ),
        _trace(
            "bar",
            x=[*ues, "L", "H"],
            y=shares.round(2).tolist(),
            name="energy",
            marker={"color": ["#8A8A8A"] * len(ues) + [LEGITIMATE_COLOR, color]},
            showlegend=False,
            text=[_short(unit * value) for value, unit in zip(spent, units, strict=True)]
            if labelled
            else None,
            customdata=told,
            hovertemplate="%{x}: %{customdata}, %{y:.1f} %<extra></extra>",
            xaxis="x3",
            yaxis="y3",
            **label_style,
        ),
    ]


def _short(value: float) -> str:
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"


def _sum_rates(flight: _Flight, slot: int, color: str) -> list[Trace]:
    """The secrecy sum-rates earned up to the slot, and a mark at the slot."""
    earned = flight.rows["secrecy_sum_rate"].to_numpy(float).round(4)
    common = {"showlegend": False, "xaxis": "x4", "yaxis": "y4"}
    return [
        _trace(
            "bar",
            x=list(range(1, slot + 2)),
            y=earned[: slot + 1].tolist(),
            marker={"color": translucent(color, 0.45)},
            hovertemplate="slot %{x}: %{y:.2f} bps/Hz earned<extra></extra>",
            **common,
        ),
        _trace(
            "scatter",
            x=[slot + 1],
            y=[float(earned[slot])],
            mode="markers",
            marker={"size": 11, "color": color, "line": {"color": "white", "width": 1.5}},
            hovertemplate="slot %{x}: %{y:.2f} bps/Hz earned<extra></extra>",
            cliponaxis=False,
            **common,
        ),
    ]


def _trace(kind: str, **values: Any) -> Trace:
    return {"type": kind, **values}


def _circle(center: Point, radius: float) -> tuple[list[float], list[float]]:
    angles = np.linspace(0.0, 2.0 * np.pi, 61)
    x, y = center[0] + radius * np.cos(angles), center[1] + radius * np.sin(angles)
    return x.round(1).tolist(), y.round(1).tolist()


def _disk(points: tuple[Any, Any], color: str, name: str) -> Trace:
    line = {"color": translucent(color, 0.6), "width": 1}
    trace = _line(*points, line, name)
    return trace | {"fill": "toself", "fillcolor": translucent(color, 0.08)}


def _line(x: Any, y: Any, style: dict[str, Any], name: str, *, legend: bool = False) -> Trace:
    return _trace(
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
    return _trace(
        "scatter",
        x=[position[0]],
        y=[position[1]],
        name=name,
        mode="markers",
        marker={"symbol": symbol, "size": 14, "color": color, "line": {"width": 3, "color": color}},
        hovertemplate=f"{name}<br>(%{{x:.1f}}, %{{y:.1f}}) m<extra></extra>",
        cliponaxis=False,
    )
