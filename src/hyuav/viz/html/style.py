"""What all figures of a report share: colors, lines, fonts, and text that stays text."""

import html
from typing import Any

from hyuav.experiments.schemes import LABELS, SCHEMES, Kind
from hyuav.viz.paper import COLORS

OPTIMUM_COLOR = "#6B6B6B"
GRID_COLOR = "#E6E6E6"
INK = "#222222"

FONT = {"family": "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", "color": INK}

DASHES = {"relay": "solid", "jamming": "6px,3px", "optimum": "2px,3px"}
"""Lines of what relays, or may, of what only jams, and of optima; as in the printed figures."""


def scheme_color(scheme: str) -> str:
    """The scheme's color in every figure; grey for an unknown one."""
    return COLORS.get(scheme, OPTIMUM_COLOR)


def scheme_label(scheme: str) -> str:
    """The scheme's name in every figure."""
    return LABELS.get(scheme, plain(scheme))


def scheme_dash(scheme: str) -> str:
    """The scheme's line in every figure."""
    known = SCHEMES.get(scheme)
    if known is not None and known.kind is Kind.OPTIMUM:
        return DASHES["optimum"]
    return DASHES["jamming" if known is not None and known.mode_rule == "jamming" else "relay"]


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
        "template": "plotly_white",
        "font": FONT | {"size": 12},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "dragmode": False,
        "hovermode": "closest",
        "hoverlabel": {"font": FONT | {"size": 12}, "bgcolor": "white"},
    }


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
