"""Where the parts of the flight player stand, on a wide page and on a phone."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from hyuav.physics.scenario import Scenario
from hyuav.viz.html.style import axis, legend_below, square_map

_SLOT_SECONDS = 0.6


def layouts(
    scenario: Scenario, num_slots: int, highest: Sequence[float]
) -> dict[str, dict[str, Any]]:
    """The layout's parts: ``shared``, and what ``wide`` and ``narrow`` pages change in it.

    Args:
        scenario: whose map is shown.
        num_slots: T of the flight.
        highest: of the secrecy rates and of the sum-rates, in bps/Hz.
    """
    rate, sum_rate = (1.18 * max(value, 1e-3) for value in highest)
    shared = {
        "title": {"x": 0.0, "xref": "paper", "xanchor": "left", "font": {"size": 14}},
        "bargap": 0.25,
        "barmode": "overlay",
        **square_map(scenario.map_side / 2),
        "xaxis2": axis("UE", anchor="y2", type="category"),
        "yaxis2": axis("Secrecy rate<br>(bps/Hz)", anchor="x2", range=[0, rate], nticks=5),
        "xaxis3": axis("UEs (mJ), L and H (J)", anchor="y3", type="category"),
        "yaxis3": axis("Energy<br>(% of budget)", anchor="x3", range=[0, 122], nticks=5),
        "xaxis4": axis("Slot", anchor="y4", nticks=10, range=[0.4, num_slots + 0.6]),
        "yaxis4": axis("Sum-rate<br>(bps/Hz)", anchor="x4", range=[0, sum_rate], nticks=5),
    }
    return {"shared": shared, "wide": _wide(), "narrow": _narrow()}


def rearranged(layout: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A layout with changes named as in a browser: ``xaxis.domain``, ``sliders[0].x``.

    Args:
        layout: in plain values, which are changed in place.
        changes: such as those of ``wide`` pages.
    """
    for name, value in changes.items():
        *path, last = re.findall(r"\w+", name)
        part: Any = layout
        for step in path:
            part = part[int(step) if step.isdigit() else step]
        part[last] = value
    return layout


def power_axis(scenario: Scenario) -> dict[str, Any]:
    """The axis of the helper's power, on the right of the sum-rates.

    Args:
        scenario: whose range of power is shown.
    """
    beside = {"anchor": "x4", "overlaying": "y4", "side": "right", "showgrid": False}
    lowest = -scenario.power_range
    look = {"range": [1.05 * lowest, -0.05 * lowest], "tickvals": [lowest, lowest / 2, 0]}
    return {"yaxis5": axis("Power of H<br>(dB)", **beside, **look)}


def _wide() -> dict[str, Any]:
    beside = [0.56, 1.0]
    return {
        "height": 740,
        "margin": {"l": 60, "r": 20, "t": 70, "b": 170},
        "title.y": 0.975,
        "xaxis.domain": [0.0, 0.48],
        "yaxis.domain": [0.0, 1.0],
        **_panels(beside, {4: [0.74, 1.0], 2: [0.37, 0.63], 3: [0.0, 0.26]}),
        "legend": legend_below(y=-0.1, xanchor="left"),
        "sliders[0].x": 0.17,
        "sliders[0].len": 0.83,
        "sliders[0].y": -0.22,
        "updatemenus[0].x": 0.0,
        "updatemenus[0].y": -0.25,
    }


def _narrow() -> dict[str, Any]:
    return {
        "height": 1330,
        "margin": {"l": 58, "r": 12, "t": 70, "b": 180},
        "title.y": 0.985,
        "xaxis.domain": [0.0, 1.0],
        "yaxis.domain": [0.7, 1.0],
        **_panels([0.0, 1.0], {4: [0.39, 0.515], 2: [0.195, 0.32], 3: [0.0, 0.125]}),
        "legend": legend_below(
            x=-0.16, xanchor="left", y=-0.055, entrywidth=107, font={"size": 10.5}
        ),
        "sliders[0].x": 0.0,
        "sliders[0].len": 1.0,
        "sliders[0].y": 0.665,
        "updatemenus[0].x": 0.0,
        "updatemenus[0].y": 0.585,
    }


def _panels(across: list[float], up: dict[int, list[float]]) -> dict[str, Any]:
    return {
        f"{name}{number}.domain": domain
        for number, own in up.items()
        for name, domain in (("xaxis", across), ("yaxis", own))
    }


def animation_controls(num_slots: int) -> dict[str, Any]:
    """The slider over the slots, and the buttons that play and pause.

    Args:
        num_slots: T.
    """
    at_once = {"mode": "immediate", "transition": {"duration": 0}}
    jump = at_once | {"frame": {"duration": 0, "redraw": True}}
    play = at_once | {"frame": {"duration": 1e3 * _SLOT_SECONDS, "redraw": True}}
    steps = [
        {"label": str(slot), "method": "animate", "args": [[str(slot)], jump]}
        for slot in range(1, num_slots + 1)
    ]
    buttons = [
        {"label": "▶ Play", "method": "animate", "args": [None, play | {"fromcurrent": True}]},
        {"label": "❚❚ Pause", "method": "animate", "args": [[None], jump]},
    ]
    return {
        "sliders": [
            {
                "active": 0,
                "steps": steps,
                "currentvalue": {"prefix": "Slot ", "xanchor": "left"},
                "pad": {"t": 0, "b": 0},
                "yanchor": "top",
                "minorticklen": 0,
            }
        ],
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "left",
                "showactive": False,
                "buttons": buttons,
                "xanchor": "left",
                "yanchor": "top",
                "pad": {"t": 0, "r": 8},
            }
        ],
    }
