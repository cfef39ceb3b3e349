"""The map of regimes: a Plotly figure, which tells each point's values, and its report."""

from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from hyuav._support.errors import InputError
from hyuav._support.formatting import percent
from hyuav.experiments.regimes.plan import Axis
from hyuav.experiments.regimes.work import REGIMES_FILE, SCHEMES
from hyuav.viz.data.reading import readable_config
from hyuav.viz.data.regimes import (
    GAIN_LEVELS,
    LABELS,
    NEAR,
    NOTHING,
    REGIME_COLORS,
    REGIMES,
    SHADES,
    STEPS,
    RegimeMap,
    axis_label,
    edges,
    read_regimes,
    shade,
    shares_table,
    times,
)
from hyuav.viz.html.document import Page, Picture, Section
from hyuav.viz.html.run import config_section
from hyuav.viz.html.style import axis, base_layout, legend_below, plain
from hyuav.viz.html.tables import html_table

BEST, GAIN = "best", "gain"

VIEWS = {BEST: "Best scheme at fixed power", GAIN: "What power control adds"}
"""What the figure may show."""


def regimes_page(directory: Path) -> Page:
    """What the directory of a map tells, however much of it is there yet."""
    facts: dict[str, str] = {}
    try:
        found = read_regimes(directory)
    except InputError as error:
        begun = (directory / REGIMES_FILE).exists()
        shown = Section("Regimes", [str(error) if begun else "The map is not finished yet."])
    else:
        pictures = [
            Picture(title, {"": regimes_map(found, view)}, small=True)
            for view, title in VIEWS.items()
        ]
        notes = [
            "The best flights under each scheme, solved at each point. Hybrid holds relaying and "
            "jamming, so that it is never worse: the simplest scheme that comes within "
            f"{percent(NEAR, 0)} of the best is named. {SHADES}",
            f"The star marks {found.own_label}.",
        ]
        shown = Section("Regimes", notes, pictures, [shares_html(found)])
        facts["Scenario"] = found.name
        facts["Points"] = f"{found.axes.x.points} x {found.axes.y.points}"
    sections = [shown, config_section(readable_config(directory))]
    return Page("Map of regimes", directory.resolve().name, facts, sections)


def shares_html(found: RegimeMap) -> Markup:
    """On how much of the map each scheme is best, and by how much at most."""
    swatch = Markup('<span class="swatch" style="background:{}"></span>{}')
    rows = [
        (
            swatch.format(REGIME_COLORS[row["best"]], LABELS[row["best"]]),
            percent(row["share"]),
            times(row["factor"]),
        )
        for _, row in shares_table(found).iterrows()
    ]
    headings = "Best at fixed power", "Share of the map", "Times the others, at most"
    return html_table("Shares of the map", headings, rows)


def regimes_map(found: RegimeMap, view: str = BEST) -> go.Figure:
    """Which scheme is best at each point, or how many times as much power control brings.

    Args:
        found: the map.
        view: of :data:`VIEWS`.
    """
    figure = go.Figure(layout=base_layout())
    shown = _best(found) if view == BEST else _gain(found)
    x, y = found.axes.x, found.axes.y
    figure.add_heatmap(
        x=edges(x), y=edges(y), customdata=_told(found), hovertemplate=_template(found), **shown
    )
    for name in found.present if view == BEST else ():
        figure.add_scatter(
            x=[None],
            y=[None],
            name=LABELS[name],
            mode="markers",
            marker={"symbol": "square", "size": 11, "color": REGIME_COLORS[name]}
            | {"line": {"color": "#9A9A9A", "width": 1 if name == NOTHING else 0}},
        )
    _add_own(figure, found)
    figure.update_layout(
        height=600,
        showlegend=True,
        margin={"l": 8, "r": 8, "t": 12, "b": 150},
        legend=legend_below(yref="container", y=0.01, yanchor="bottom"),
        xaxis=_axis(x),
        yaxis=_axis(y),
    )
    return figure


def _best(found: RegimeMap) -> dict[str, Any]:
    """Each regime's shades as the colors of whole numbers; where nothing is secret there is one."""
    shades = len(STEPS) + 1
    place = np.vectorize(REGIMES.index)(found.grid("best"))
    colors = [shade(REGIME_COLORS[name], number) for name in REGIMES for number in range(shades)]
    steps = [
        [(number + end) / len(colors), color]
        for number, color in enumerate(colors)
        for end in (0, 1)
    ]
    codes = place * shades + np.where(place == REGIMES.index(NOTHING), 0, found.shades)
    limits = {"zmin": -0.5, "zmax": len(colors) - 0.5}
    return {"z": codes, "colorscale": steps, "showscale": False, **limits}


def _gain(found: RegimeMap) -> dict[str, Any]:
    """The logarithm of the gain; where nothing is secret there is a gap."""
    gains = found.grid("gain")
    most = max(gains[np.isfinite(gains)].max(initial=1.0), GAIN_LEVELS[0])
    most = min(most, GAIN_LEVELS[-1])
    ticks = [1.0, *(level for level in (1.2, 1.5, 2.0, *GAIN_LEVELS[6:]) if level <= most)]
    return {
        "z": np.log(np.clip(gains, 1.0, most)),
        "zmin": 0.0,
        "zmax": float(np.log(most)),
        "colorscale": "Viridis",
        "colorbar": {
            "title": {"text": "Times the best at fixed power", "side": "bottom"},
            "tickvals": np.log(ticks),
            "ticktext": [f"{level:g}" for level in ticks],
            "orientation": "h",
            "thickness": 12,
            "y": -0.13,
            "yanchor": "top",
        },
    }


def _told(found: RegimeMap) -> Any:
    """What a point's text is filled with, (Y, X, ...)."""
    columns = [found.grid(name) for name in (*found.rows.columns[:2], *SCHEMES, "factor", "gain")]
    names = np.vectorize(LABELS.__getitem__)(found.grid("best"))
    return np.stack([*(column.astype(object) for column in columns), names], axis=-1)


def _template(found: RegimeMap) -> str:
    axes = [plain(axis_label(own)) for own in (found.axes.x, found.axes.y)]
    last = 2 + len(SCHEMES)
    return "<br>".join(
        [
            *(f"{label}: %{{customdata[{place}]:.4~g}}" for place, label in enumerate(axes)),
            *(
                f"{LABELS[name]}: %{{customdata[{place}]:.2f}} bps/Hz"
                for place, name in enumerate(SCHEMES, start=2)
            ),
            f"<b>%{{customdata[{last + 2}]}}</b>: %{{customdata[{last}]:.3~g}} times the others, "
            f"with power control %{{customdata[{last + 1}]:.3~g}} times that<extra></extra>",
        ]
    )


def _add_own(figure: go.Figure, found: RegimeMap) -> None:
    x, y = found.own
    edge = {"color": "black", "width": 1}
    figure.add_scatter(
        x=[x],
        y=[y],
        name=found.own_label,
        mode="markers",
        marker={"symbol": "star", "size": 14, "color": "white", "line": edge},
        hoverinfo="skip",
    )


def _axis(swept: Axis) -> dict[str, Any]:
    ends = edges(swept)[[0, -1]]
    is_log = swept.scale == "log"
    limits = np.log10(ends) if is_log else ends
    more = {"type": "log", "dtick": 1, "exponentformat": "power"} if is_log else {}
    return axis(plain(axis_label(swept)), range=limits.tolist(), showgrid=False, **more)
