"""Maps of a scenario and of the flights over it, drawn with matplotlib."""

from typing import Any

import matplotlib as mpl
import numpy as np
import torch
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from hyuav._support.errors import InputError, rejection
from hyuav.envs.appearance import (
    EAVESDROPPER_COLOR,
    EAVESDROPPER_LABEL,
    HELPER_COLOR,
    HELPER_LABEL,
    LEGITIMATE_COLOR,
    LEGITIMATE_LABEL,
    UE_COLOR,
    runs_of_one_mode,
)
from hyuav.physics.channel import horizontal_distance
from hyuav.physics.layout import Nodes
from hyuav.physics.offloading import covered
from hyuav.physics.scenario import Point, Scenario

_FRAME_INCHES, _FRAME_DPI = (7.6, 5.2), 100  # even numbers of pixels, as video encoders want
_FRAME_MAP, _FRAME_LEGEND = (0.13, 0.11, 0.55, 0.55 * 7.6 / 5.2), (0.69, 0.935)


def draw_scenario(axes: Axes, scenario: Scenario, covered: ArrayLike | None = None) -> None:
    """Draw the map: the UEs, the legitimate UAV with its coverage, the eavesdropper.

    The axes are in metres, of equal scale, and end where the map ends. The nodes carry labels
    for a legend. Sizes follow matplotlib's ``lines.markersize`` and ``lines.linewidth``.

    Args:
        axes: to draw on.
        scenario: what to draw.
        covered: (U,) bool, the UEs drawn filled, the others being hollow; None fills all.

    Raises:
        InputError: ``covered`` has another shape than (U,).
    """
    half = scenario.map_side / 2
    axes.set(xlim=(-half, half), ylim=(-half, half), xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.set_axisbelow(True)
    axes.grid(color="0.92", linewidth=_width(0.5))
    draw_coverage(axes, scenario.legitimate_position, scenario.coverage_radius, LEGITIMATE_COLOR)
    _draw_uavs(axes, [scenario.legitimate_position], LEGITIMATE_LABEL, _LEGITIMATE)
    _draw_uavs(axes, scenario.eavesdropper_positions, EAVESDROPPER_LABEL, _EAVESDROPPER)
    if covered is None:
        _draw_ues(axes, np.asarray(scenario.ue_positions), UE_COLOR, "UE")
        return
    chosen = np.asarray(covered)
    if chosen.shape != (scenario.num_ues,):
        raise InputError(rejection("covered", chosen.shape, f"shape {(scenario.num_ues,)}"))
    chosen = chosen.astype(bool)
    _draw_ues(axes, np.asarray(scenario.ue_positions)[chosen], UE_COLOR, "UE, covered")
    _draw_ues(axes, np.asarray(scenario.ue_positions)[~chosen], "white", "UE, not covered")


def draw_coverage(axes: Axes, center: Point, radius: float, color: str) -> None:
    """Draw the disk of ``radius`` m around ``center``, cut off where the map ends."""
    disk = Circle(center, radius, facecolor=(color, 0.08), edgecolor=(color, 0.7), zorder=1)
    axes.add_patch(disk)


def draw_flight(
    axes: Axes, positions: ArrayLike, modes: ArrayLike, color: str, label: str | None = None
) -> None:
    """Draw one flight: solid with full dots in relay slots, dashed with hollow dots in jamming.

    A dot marks where each slot was spent, a diamond the start and a star the end.

    Args:
        axes: to draw on.
        positions: (T + 1, 2) m, the start and then the position in each slot.
        modes: (T,) of each slot, 1 relay and 0 jamming.
        color: of the flight.
        label: of the flight in a legend.

    Raises:
        InputError: the shapes do not belong together.
    """
    path, relays = np.asarray(positions, dtype=float), np.asarray(modes).astype(bool)
    if path.ndim != 2 or path.shape[1] != 2 or len(path) == 0:
        raise InputError(rejection("positions", path.shape, "shape (T + 1, 2)"))
    if relays.shape != (len(path) - 1,):
        raise InputError(rejection("modes", relays.shape, f"shape {(len(path) - 1,)}"))
    for relay, first, last in runs_of_one_mode(relays):
        axes.plot(*path[first : last + 1].T, **_slot_style(color, relay=relay) | {"marker": ""})
        axes.plot(*path[first + 1 : last + 1].T, **_slot_style(color, relay=relay) | _DOTS_ONLY)
    edge = {"markeredgecolor": "white", "markeredgewidth": _width(0.5)}
    ends = _DOTS_ONLY | {"color": color} | edge
    axes.plot(*path[0], **ends | {"marker": "D", "markersize": _size(1.3)})
    if len(path) > 1:
        axes.plot(*path[-1], **ends | {"marker": "*", "markersize": _size(2.6)})
    if label is not None:
        axes.plot([], [], color=color, linewidth=_width(1.3), label=label)


def mode_handles(color: str = "0.3") -> list[Line2D]:
    """The legend's samples of how :func:`draw_flight` shows the modes: relay, then jamming."""
    return [
        Line2D([], [], **_slot_style(color, relay=True), label="helper relays"),
        Line2D([], [], **_slot_style(color, relay=False), label="helper jams"),
    ]


def _frame_handles() -> list[Artist]:
    """The legend's samples of what a frame shows besides the nodes."""
    ends = _DOTS_ONLY | {"color": HELPER_COLOR}
    return [
        Patch(facecolor=("0.5", 0.08), edgecolor=("0.5", 0.7), label="coverage"),
        Line2D([], [], **ends, marker="D", markersize=_size(1.3), label="start"),
        Line2D([], [], **ends, marker="*", markersize=_size(2.6), label="latest slot"),
        *mode_handles(HELPER_COLOR),
    ]


def render_frame(
    scenario: Scenario, positions: ArrayLike, modes: ArrayLike, slots_flown: int | None = None
) -> NDArray[np.uint8]:
    """Draw flights up to now, with the coverage of this slot, as a picture.

    Args:
        scenario: that is flown.
        positions: (t + 1, H, 2) m, the helpers' starts and then their positions in each slot up to
            now; of one helper (t + 1, 2) as well.
        modes: (t + 1, H) 1 relay, 0 jamming, at the start and of each slot; or (t + 1,).
        slots_flown: since the start, where more than the last t; None for t.

    Returns:
        (height, width, 3) red, green and blue.
    """
    paths = np.asarray(positions, dtype=float)
    paths = paths.reshape(len(paths), -1, 2)
    relays = np.asarray(modes).astype(bool).reshape(len(paths), -1)
    slot = len(paths) - 1 if slots_flown is None else slots_flown
    figure = Figure(figsize=_FRAME_INCHES, dpi=_FRAME_DPI)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes(_FRAME_MAP)  # fixed, so that the map keeps still from frame to frame
    draw_scenario(axes, scenario, _covered(scenario, paths[-1], relays[-1]))
    for helper in range(paths.shape[1]):
        path = paths[:, helper]
        here = (float(path[-1, 0]), float(path[-1, 1]))
        draw_coverage(axes, here, scenario.coverage_radius, HELPER_COLOR)
        draw_flight(axes, path, relays[1:, helper], HELPER_COLOR)
    _draw_uavs(axes, paths[-1], HELPER_LABEL, _HELPER)
    told = ", ".join("relay" if relaying else "jamming" for relaying in relays[-1])
    axes.set_title(f"slot {slot} of {scenario.num_slots}, {told}")
    nodes, _ = axes.get_legend_handles_labels()
    figure.legend(
        handles=[*nodes, *_frame_handles()],
        loc="upper left",
        bbox_to_anchor=_FRAME_LEGEND,
        frameon=False,
        labelspacing=1.0,
    )
    pixels, (width, height) = canvas.print_to_buffer()  # type: ignore[no-untyped-call]
    return np.frombuffer(pixels, np.uint8).reshape(height, width, 4)[..., :3].copy()


def _covered(
    scenario: Scenario, helpers: NDArray[np.float64], relays: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Eq. 5 with the helpers at (H, 2) m in modes (H,): the UEs that have a way to send, (U,)."""
    nodes, radius = Nodes.of(scenario, "cpu"), scenario.coverage_radius
    places = nodes.ue.new_tensor(helpers)
    near = covered(horizontal_distance(nodes.ue.unsqueeze(1), places), radius)
    way = (near | ~torch.from_numpy(relays)).any(dim=-1)
    return (way & covered(horizontal_distance(nodes.ue, nodes.legitimate), radius)).numpy()


def _draw_ues(axes: Axes, positions: NDArray[np.float64], face: str, label: str) -> None:
    axes.plot(
        *positions.T,
        linestyle="",
        marker="o",
        markersize=_size(0.9),
        markerfacecolor=face,
        markeredgecolor=UE_COLOR,
        path_effects=[withStroke(linewidth=_width(1.2), foreground="white")],
        label=label,
        clip_on=False,
        zorder=4,
    )


def _draw_uavs(axes: Axes, positions: ArrayLike, label: str, style: dict[str, Any]) -> None:
    scaled = style | {"markersize": _size(style["markersize"])}
    axes.plot(*np.asarray(positions).T, linestyle="", label=label, clip_on=False, **scaled)


_RIM: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.4}  # on dark maps
_LEGITIMATE: dict[str, Any] = _RIM | {
    "color": LEGITIMATE_COLOR,
    "marker": "s",
    "markersize": 1.8,
    "zorder": 2,
}
_EAVESDROPPER: dict[str, Any] = _RIM | {
    "color": EAVESDROPPER_COLOR,
    "marker": "v",
    "markersize": 2.3,
    "zorder": 2,
}
# A ring, so that what the helper hovers over stays visible.
_HELPER: dict[str, Any] = {
    "color": HELPER_COLOR,
    "marker": "o",
    "markersize": 3.2,
    "markerfacecolor": "none",
    "markeredgewidth": 2.0,
    "zorder": 4.5,
}
_DOTS_ONLY: dict[str, Any] = {"linestyle": "", "clip_on": False, "zorder": 3}


def _size(factor: float) -> float:
    """A marker's size in points, in proportion to matplotlib's settings."""
    return factor * float(mpl.rcParams["lines.markersize"])


def _width(factor: float) -> float:
    """A line's width in points, in proportion to matplotlib's settings."""
    return factor * float(mpl.rcParams["lines.linewidth"])


def _slot_style(color: str, *, relay: bool) -> dict[str, Any]:
    return {
        "color": color,
        "linestyle": "-" if relay else (0, (4, 2)),
        "linewidth": _width(1.05),
        "marker": "o",
        "markersize": _size(0.75),
        "markerfacecolor": color if relay else "white",
        "zorder": 2.5,
    }
