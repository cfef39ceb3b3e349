"""What all figures of a report share: lines, fonts, axes, and text that stays text."""

import html
from functools import cache
from typing import Any

from plotly.io import templates

from hyuav.viz.data.schemes import Line

GRID_COLOR = "#E6E6E6"
INK = "#222222"

FONT = {"family": "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", "color": INK}

DASHES: dict[Line, str] = {"solid": "solid", "dashed": "6px,3px", "dotted": "2px,3px"}
"""The lines of :func:`hyuav.viz.data.schemes.scheme_line`."""


def plain(text: object) -> str:
    """Text of unknown origin for a figure, in which Plotly finds no tags."""
    return html.escape(str(text), quote=False)


def translucent(color: str, alpha: float) -> str:
    """A color ``#RRGGBB`` as ``rgba(...)``."""
    red, green, blue = (int(color[start : start + 2], 16) for start in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha:g})"


def base_layout() -> dict[str, Any]:
    """The layout that every figure starts from."""
    return {
        "template": _template(),
        "font": FONT | {"size": 12},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "dragmode": False,
        "hovermode": "closest",
        "hoverlabel": {"font": FONT | {"size": 12}, "bgcolor": "white"},
    }


@cache
def _template() -> dict[str, Any]:
    """What Plotly draws with where a figure says nothing, in plain values."""
    values: dict[str, Any] = templates["plotly_white"].to_plotly_json()
    return values


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis with its title, which names the unit."""
    return {
        "title": {"text": title, "standoff": 6},
        "gridcolor": GRID_COLOR,
        "zeroline": False,
        "showline": True,
        "linecolor": "#9A9A9A",
        "ticks": "outside",
        "ticklen": 3,
        "automargin": True,
        **more,
    }


def legend_below(**place: Any) -> dict[str, Any]:
    """A legend in rows, from the left, below the plot."""
    return {"orientation": "h", "x": 0.0, "yanchor": "top"} | place


def square_map(half: float) -> dict[str, Any]:
    """Both axes of a map that ends ``half`` m from its middle, with the same scale."""
    both = {"range": [-half, half], "constrain": "domain", "nticks": 6, "mirror": True}
    return {
        "xaxis": axis("x (m)", **both),
        "yaxis": axis("y (m)", **both, scaleanchor="x", scaleratio=1),
    }
