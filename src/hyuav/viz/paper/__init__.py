"""The figures: learning, flights, secrecy sum-rates, energy and offloading, for print."""

from hyuav.viz.paper.curves import learning_curves, learning_table
from hyuav.viz.paper.flights import flight_map, save_flight_map, trajectories
from hyuav.viz.paper.maps import sum_rate_maps
from hyuav.viz.paper.style import COLORS, COLUMN_WIDTH, LINES, PAGE_WIDTH, STYLE, save_figure

__all__ = [
    "COLORS",
    "COLUMN_WIDTH",
    "LINES",
    "PAGE_WIDTH",
    "STYLE",
    "flight_map",
    "learning_curves",
    "learning_table",
    "save_figure",
    "save_flight_map",
    "sum_rate_maps",
    "trajectories",
]
