"""The figures: learning, flights, secrecy sum-rates, energy and offloading, for print."""

from hyuav.viz.paper.style import COLUMN_WIDTH, PAGE_WIDTH, STYLE, save_figure

__all__ = ["COLUMN_WIDTH", "PAGE_WIDTH", "STYLE", "save_figure"]
