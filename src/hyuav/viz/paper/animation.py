"""A flight in motion: coverage, links and modes, slot by slot."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from hyuav._support.files import write_durably
from hyuav.envs.appearance import UE_COLOR
from hyuav.envs.rendering import (
    draw_coverage,
    draw_flight,
    draw_scenario,
)
from hyuav.physics.scenario import Point, Scenario
from hyuav.viz.data.flights import Flight, links, names, told_modes
from hyuav.viz.data.schemes import COLORS, scheme_label
from hyuav.viz.paper.style import MODE_COLORS, STYLE

INCHES, DPI = (3.5, 5.0), 140
SLOTS_PER_SECOND, SLOTS_HELD = 2, 3
"""How fast the slots follow each other, and for how many the last one stays."""

LINK_COLOR = "0.35"
"""Of what UEs send."""

JAMMING: dict[str, Any] = {
    "color": MODE_COLORS["jamming"],
    "linestyle": "dashed",
    "linewidth": 1.6,
}
"""The line from the helper to the eavesdropper that it jams."""


MIXED = "0.6"
"""Color of a slot in which some helpers relay and others jam."""


def animate_flight(scenario: Scenario, flight: Flight, file: Path) -> None:
    """Write a flight as an animated GIF: who offloads to whom, in which mode, and what it brings.

    Args:
        scenario: that is flown.
        flight: that is shown.
        file: to write.

    Raises:
        OSError: it cannot be written; then an earlier one is still there.
    """
    with mpl.rc_context(STYLE), tempfile.TemporaryDirectory() as elsewhere:
        figure = Figure(figsize=INCHES)
        over_map = figure.add_axes((0.17, 0.395, 0.79, 0.79 * INCHES[0] / INCHES[1]))
        over_time = figure.add_axes((0.17, 0.21, 0.79, 0.09))
        _draw_legend(figure, mixed=scenario.num_helpers > 1)
        writer = PillowWriter(fps=SLOTS_PER_SECOND)
        drawn = Path(elsewhere) / file.name  # Pillow tells the format by the name
        with writer.saving(figure, str(drawn), DPI):
            for flown in range(flight.num_slots + 1):
                over_map.clear()
                _draw_map(over_map, scenario, flight, flown)
                over_time.clear()
                _draw_rates(over_time, flight, flown)
                writer.grab_frame()
            for _ in range(SLOTS_HELD):
                writer.grab_frame()
        write_durably(file, drawn.read_bytes())


def _draw_map(axes: Axes, scenario: Scenario, flight: Flight, flown: int) -> None:
    """The flight up to now, with the links of the last of its slots."""
    offloading = flight.offloading[flown - 1] if flown else [False] * scenario.num_ues
    draw_scenario(axes, scenario, offloading)
    helpers, color = flight.helpers(flown), COLORS[flight.scheme]
    for number, helper in enumerate(helpers):
        path, relay = flight.path[: flown + 1, number], flight.relay[:flown, number]
        draw_coverage(axes, helper, scenario.coverage_radius, color)
        draw_flight(axes, path, relay, color)
    ring: Any = {
        "marker": "o",
        "markersize": 10.0,
        "markerfacecolor": "white",
        "markeredgewidth": 1.6,
    }
    x, y = zip(*helpers, strict=True)
    axes.plot(x, y, linestyle="", color=color, clip_on=False, zorder=4.5, **ring)
    _draw_letters(axes, scenario, helpers)
    title = f"slot {flown} of {scenario.num_slots}"
    if flown:
        told = told_modes(flight.relay[flown - 1])
        axes.set_title(f"{scheme_label(flight.scheme)}, {title}: {told}")
        _draw_links(axes, scenario, flight, flown)
    else:
        axes.set_title(f"{title}: start")


def _draw_letters(axes: Axes, scenario: Scenario, helpers: Sequence[Point]) -> None:
    """Name the UAVs: the helpers within their rings, the others beside their places."""
    eavesdroppers = scenario.eavesdropper_positions
    in_ring = ["H"] if len(helpers) == 1 else [str(n) for n in range(1, len(helpers) + 1)]
    letters = [
        ("L", scenario.legitimate_position, (9, -9)),
        *(
            (name, at, (-10, 7))
            for name, at in zip(names("E", len(eavesdroppers)), eavesdroppers, strict=True)
        ),
        *((name, at, (0, 0)) for name, at in zip(in_ring, helpers, strict=True)),
    ]
    for letter, place, offset in letters:
        axes.annotate(
            letter,
            place,
            offset,
            textcoords="offset points",
            ha="center",
            va="center",
            weight="bold",
            fontsize=7,
            path_effects=[withStroke(linewidth=1.5, foreground="white")],
            zorder=5,
        )


def _draw_links(axes: Axes, scenario: Scenario, flight: Flight, flown: int) -> None:
    """What each UE that offloads sends, what helpers relay, and what they jam."""
    sent: Any = {"color": LINK_COLOR, "linewidth": 0.7, "zorder": 2.2}
    styles = (sent, sent, sent | {"linewidth": 1.6}, JAMMING | {"zorder": 2.6})
    for ends, style in zip(links(scenario, flight, flown - 1), styles, strict=True):
        for own in ends:
            axes.plot(*zip(*own, strict=True), **style)


def _draw_rates(axes: Axes, flight: Flight, flown: int) -> None:
    """The secrecy sum-rate of each slot up to now."""
    rates = flight.rows["secrecy_sum_rate"].to_numpy(float)
    share = flight.relay[:flown].mean(axis=1)
    colors = [{0.0: MODE_COLORS["jamming"], 1.0: MODE_COLORS["relay"]}.get(x, MIXED) for x in share]
    axes.bar(range(1, flown + 1), rates[:flown], color=colors, width=0.8)
    highest = max(float(rates.max()), 1.0)
    axes.set(xlim=(0.4, flight.num_slots + 0.6), ylim=(0, 1.05 * highest), xlabel="Slot")
    axes.set_ylabel("Sum-rate\n(bps/Hz)")
    axes.xaxis.set_major_locator(MaxNLocator(10, integer=True, steps=[1, 2, 5, 10]))


def _draw_legend(figure: Figure, *, mixed: bool) -> None:
    ue: Any = {"color": UE_COLOR, "marker": "o", "markersize": 3.5}
    handles = [
        Line2D([], [], **ue, markerfacecolor=UE_COLOR, linestyle="", label="UE offloads"),
        Line2D([], [], **ue, markerfacecolor="white", linestyle="", label="UE computes itself"),
        Line2D([], [], color=LINK_COLOR, linewidth=0.7, label="offloading"),
        Line2D([], [], **JAMMING, label="jamming of E"),
        *(
            Patch(facecolor=MODE_COLORS[mode], label=f"sum-rate, {mode}")
            for mode in ("relay", "jamming")
        ),
    ]
    if mixed:
        handles.append(Patch(facecolor=MIXED, label="sum-rate, some relay, some jam"))
    figure.legend(handles=handles, loc="lower center", ncols=2, frameon=False, fontsize=6.5)
