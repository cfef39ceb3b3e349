"""The figures: learning, flights, secrecy sum-rates, energy and offloading, for print."""

from hyuav.figures.curves import learning_curves, learning_table
from hyuav.figures.flights import flight_map, save_flight_map, trajectories
from hyuav.figures.maps import sum_rate_maps
from hyuav.figures.style import COLORS, COLUMN_WIDTH, LINES, PAGE_WIDTH, STYLE, save_figure

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
