"""Flights over the map: the paper's Fig. 3, and every scheme over its own optimum."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from hyuav.envs.appearance import LEGITIMATE_COLOR
from hyuav.envs.rendering import draw_flight, draw_scenario, mode_handles
from hyuav.experiments.schemes import LABELS, OPTIMUM_POWER, PROPOSED_POWER
from hyuav.physics.scenario import Point, Scenario
from hyuav.viz.data.flights import Flight, first_flights, flight_tables
from hyuav.viz.data.schemes import COLORS
from hyuav.viz.paper.style import COLUMN_WIDTH, PAGE_WIDTH, STYLE, legend_below, save_figure

FLOWN_BY_LEARNING = {"ja_ot": 2.4, "re_ot": 1.7, "proposed": 1.0}
"""Fig. 3's schemes from below, and how broadly each is drawn: none hides where they coincide."""

TRAJECTORIES = (*FLOWN_BY_LEARNING, "optimum")
"""What Fig. 3 shows."""

FLIGHT_PANELS = {
    "optimum": ["proposed", "generalist"],
    "re_optimum": ["re_ot", "re_generalist", "re_lt"],
    "ja_optimum": ["ja_ot", "ja_generalist", "ja_lt"],
    OPTIMUM_POWER: [PROPOSED_POWER],
}
"""The maps of the flight figure: the optimum underneath, and the schemes flown over it.

The last is there where a learner chose the helper's power.
"""

_PANELS_SCHEMES = [name for optimum, over in FLIGHT_PANELS.items() for name in (optimum, *over)]

OPTIMUM_COLOR, OPTIMUM_WIDTH = "0.78", 5.0


def trajectories(scenario: Scenario, flights: pd.DataFrame) -> Figure:
    """The flights of Proposed, Re-OT and Ja-OT on one map, over the hybrid optimum's.

    Relaying is solid with full dots, jamming dashed with hollow ones, a dot for each slot.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`; each scheme's first is drawn.
    """
    flown = first_flights(scenario, flights, TRAJECTORIES)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 3.95), layout="constrained")
        axes = figure.add_subplot()
        draw_scenario(axes, scenario)
        _draw_optimum(axes, flown, "optimum")
        for scheme, breadth in FLOWN_BY_LEARNING.items():
            wider: Any = {"lines.linewidth": breadth, "lines.markersize": 2.6 + breadth}
            with mpl.rc_context(wider):
                _draw_scheme(axes, flown, scheme)
        handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        lines = [LABELS[name] for name in (*reversed(FLOWN_BY_LEARNING), "optimum")]
        drawn = [handles.pop(label) for label in lines if label in handles]
        nodes = [*handles.values(), _coverage_handle()]
        samples = [*mode_handles(), *_end_handles()]
        legend_below(figure, [*nodes, *drawn, *samples], 3, handletextpad=0.6)
        return figure


def flight_map(scenario: Scenario, flights: pd.DataFrame) -> Figure:
    """The schemes' flights, a map for each rule of who chooses the mode.

    The best flight lies underneath as a broad grey line; relaying is solid, jamming dashed.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`; each scheme's first is drawn.
    """
    flown = first_flights(scenario, flights, _PANELS_SCHEMES)
    with mpl.rc_context(STYLE):
        with_power = PROPOSED_POWER in flown
        panels = list(FLIGHT_PANELS.items())[: None if with_power else -1]
        figure = Figure(figsize=(PAGE_WIDTH, 2.6 if with_power else 3.05), layout="constrained")
        row: list[Axes] = list(figure.subplots(1, len(panels), sharey=True))
        for axes, (optimum, schemes) in zip(row, panels, strict=True):
            draw_scenario(axes, scenario)
            _draw_optimum(axes, flown, optimum)
            for scheme in schemes:
                _draw_scheme(axes, flown, scheme)
            axes.set_title(" and ".join(LABELS[scheme] for scheme in schemes if scheme in flown))
            axes.label_outer()
            if with_power:  # narrow panels, whose outermost labels would touch
                quarter = scenario.map_side / 4
                axes.set_xticks([-quarter, 0.0, quarter])
        handles = {
            label: handle
            for axes in row
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        samples = [_coverage_handle(), *mode_handles(), *_end_handles()]
        legend_below(figure, [*handles.values(), *samples], 5, 1.4)
        return figure


def save_flight_map(
    scenario: Scenario, flights: pd.DataFrame, directory: Path, name: str = "flight_map"
) -> None:
    """Write :func:`flight_map` with what it shows beside it.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`.
        directory: for the files.
        name: of the figure.
    """
    tables = flight_tables(scenario, flights, _PANELS_SCHEMES)
    save_figure(flight_map(scenario, flights), directory, name, tables)


def _draw_optimum(axes: Axes, flown: Mapping[str, Flight], optimum: str) -> None:
    if optimum in flown:
        for number, path in enumerate(flown[optimum].path.swapaxes(0, 1)):
            axes.plot(
                *path.T,
                color=OPTIMUM_COLOR,
                linewidth=OPTIMUM_WIDTH,
                zorder=1.5,
                label=None if number else LABELS["optimum"],
            )


def _draw_scheme(axes: Axes, flown: Mapping[str, Flight], scheme: str) -> None:
    if scheme in flown:
        flight, color = flown[scheme], COLORS[scheme]
        for helper in range(flight.relay.shape[1]):
            label = None if helper else LABELS[scheme]
            path = flight.path[:, helper]
            draw_flight(axes, path, flight.relay[:, helper], color, label)
            if flight.relay.shape[1] > 1:
                _number(axes, helper + 1, flight.helpers(flight.num_slots)[helper], color)


def _number(axes: Axes, number: int, end: Point, color: str) -> None:
    """Tell which of several helpers ends there, beside the star, towards the middle of the map."""
    axes.annotate(
        str(number),
        end,
        (-math.copysign(7.0, end[0]), -math.copysign(7.0, end[1])),
        textcoords="offset points",
        ha="center",
        va="center",
        color=color,
        weight="bold",
        fontsize=7,
        path_effects=[withStroke(linewidth=1.5, foreground="white")],
        zorder=5,
    )


def _coverage_handle() -> Patch:
    """The legend's sample of the disk around L."""
    return Patch(
        facecolor=(LEGITIMATE_COLOR, 0.08), edgecolor=(LEGITIMATE_COLOR, 0.7), label="coverage of L"
    )


def _end_handles() -> list[Line2D]:
    """The legend's samples of a flight's start and end."""
    grey: Any = {"color": "0.3", "linestyle": ""}
    return [
        Line2D([], [], marker="D", markersize=4.5, label="start", **grey),
        Line2D([], [], marker="*", markersize=7.0, label="end", **grey),
    ]
