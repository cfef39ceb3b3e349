"""Flights over the map: the paper's Fig. 3, and every scheme over its own optimum."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from hyuav.envs.rendering import LEGITIMATE_COLOR, draw_flight, draw_scenario, mode_handles
from hyuav.experiments.evaluation import LABELS
from hyuav.physics.scenario import Scenario
from hyuav.viz.paper.style import COLORS, COLUMN_WIDTH, PAGE_WIDTH, STYLE, save_figure

FLOWN_BY_LEARNING = {"ja_ot": 2.4, "re_ot": 1.7, "proposed": 1.0}
"""Fig. 3's schemes from below, and how broadly each is drawn: none hides where they coincide."""

FLIGHT_PANELS = {
    "optimum": ["proposed"],
    "re_optimum": ["re_ot", "re_lt"],
    "ja_optimum": ["ja_ot", "ja_lt"],
}
"""The maps of the flight figure: the optimum underneath, and the schemes flown over it."""

OPTIMUM_COLOR, OPTIMUM_WIDTH = "0.78", 5.0


def first_flight(flights: pd.DataFrame, scheme: str) -> pd.DataFrame:
    """The slots of a scheme's first episode, none where it was not flown."""
    return flights[(flights["scheme"] == scheme) & (flights["episode"] == 0)]


def path_of(scenario: Scenario, slots: pd.DataFrame) -> NDArray[np.float64]:
    """The start and the position in each slot: (T + 1, 2) m."""
    return np.vstack([scenario.helper_starts[0], slots[["x", "y"]].to_numpy()])


def trajectories(scenario: Scenario, flights: pd.DataFrame) -> Figure:
    """The flights of Proposed, Re-OT and Ja-OT on one map, over the hybrid optimum's.

    Relaying is solid with full dots, jamming dashed with hollow ones, a dot for each slot.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`; each scheme's first is drawn.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 3.95), layout="constrained")
        axes = figure.add_subplot()
        draw_scenario(axes, scenario)
        _draw_optimum(axes, scenario, flights, "optimum")
        for scheme, breadth in FLOWN_BY_LEARNING.items():
            wider: Any = {"lines.linewidth": breadth, "lines.markersize": 2.6 + breadth}
            with mpl.rc_context(wider):
                _draw_scheme(axes, scenario, flights, scheme)
        handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        lines = [LABELS[name] for name in (*reversed(FLOWN_BY_LEARNING), "optimum")]
        flown = [handles.pop(label) for label in lines if label in handles]
        figure.legend(
            handles=[
                *handles.values(),
                _coverage_handle(),
                *flown,
                *mode_handles(),
                *_end_handles(),
            ],
            loc="outside lower center",
            ncols=3,
            frameon=False,
            columnspacing=1.0,
            handletextpad=0.6,
        )
        return figure


def flight_map(scenario: Scenario, flights: pd.DataFrame) -> Figure:
    """The schemes' flights, a map for each rule of who chooses the mode.

    The best flight lies underneath as a broad grey line; relaying is solid, jamming dashed.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`; each scheme's first is drawn.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_WIDTH, 3.05), layout="constrained")
        row: list[Axes] = list(figure.subplots(1, len(FLIGHT_PANELS), sharey=True))
        for axes, (optimum, schemes) in zip(row, FLIGHT_PANELS.items(), strict=True):
            draw_scenario(axes, scenario)
            _draw_optimum(axes, scenario, flights, optimum)
            for scheme in schemes:
                _draw_scheme(axes, scenario, flights, scheme)
            axes.set_title(" and ".join(LABELS[scheme] for scheme in schemes))
            axes.label_outer()
        handles = {
            label: handle
            for axes in row
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(
            handles=[*handles.values(), _coverage_handle(), *mode_handles(), *_end_handles()],
            loc="outside lower center",
            ncols=5,
            frameon=False,
            columnspacing=1.4,
        )
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
    schemes = [scheme for optimum, over in FLIGHT_PANELS.items() for scheme in (optimum, *over)]
    tables = flight_tables(scenario, flights, schemes)
    save_figure(flight_map(scenario, flights), directory, name, tables)


def flight_tables(
    scenario: Scenario, flights: pd.DataFrame, schemes: Sequence[str]
) -> dict[str, pd.DataFrame]:
    """What a map of flights shows.

    Args:
        scenario: that was flown.
        flights: a row per slot; each scheme's first is taken.
        schemes: that are drawn.

    Returns:
        "", the flights: ``scheme``, ``slot`` (0 is the start), ``x`` and ``y`` in m, and whether
        the helper does ``relay``; "nodes": each ``node`` with its ``x`` and ``y`` in m and the
        ``coverage`` radius in m of L.
    """
    paths = []
    for scheme in schemes:
        slots = first_flight(flights, scheme)
        if len(slots):
            path = path_of(scenario, slots)
            relay: list[bool | None] = [None, *slots["relay"]]
            columns = {"slot": range(len(path)), "x": path[:, 0], "y": path[:, 1], "relay": relay}
            paths.append(pd.DataFrame({"scheme": scheme, **columns}))
    places = {f"UE {u}": place for u, place in enumerate(scenario.ue_positions, start=1)}
    places |= {"L": scenario.legitimate_position, "E": scenario.eavesdropper_positions[0]}
    nodes = pd.DataFrame([(name, *place) for name, place in places.items()])
    nodes.columns = pd.Index(["node", "x", "y"])
    nodes["coverage"] = [scenario.coverage_radius if name == "L" else np.nan for name in places]
    return {"": pd.concat(paths, ignore_index=True), "nodes": nodes}


def _draw_optimum(axes: Axes, scenario: Scenario, flights: pd.DataFrame, optimum: str) -> None:
    best = first_flight(flights, optimum)
    if len(best):
        axes.plot(
            *path_of(scenario, best).T,
            color=OPTIMUM_COLOR,
            linewidth=OPTIMUM_WIDTH,
            zorder=1.5,
            label=LABELS["optimum"],
        )


def _draw_scheme(axes: Axes, scenario: Scenario, flights: pd.DataFrame, scheme: str) -> None:
    slots = first_flight(flights, scheme)
    if len(slots):
        path = path_of(scenario, slots)
        draw_flight(axes, path, slots["relay"], COLORS[scheme], LABELS[scheme])


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
