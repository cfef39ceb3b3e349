"""The player's panels: each slot's secrecy rates and energies, and the sum-rates of all slots."""

from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hyuav.envs.appearance import LEGITIMATE_COLOR, OKABE_ITO
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.flights import Flight, budgets, names
from hyuav.viz.html.player_map import Trace, trace
from hyuav.viz.html.style import DASHES, translucent

_LABELLED_UES = 24
"""Beyond this many UEs, the bars are too narrow for their values."""


def highest(flight: Flight) -> list[float]:
    """Of the secrecy rates, and of the sum-rates, in bps/Hz."""
    columns = ["secrecy_sum_rate", "relay_sum_rate", "jamming_sum_rate"]
    return [float(flight.secrecy_rate.max()), float(flight.rows[columns].to_numpy(float).max())]


def fixed_in_panels(flight: Flight) -> list[Trace]:
    """The sum-rates that each mode would have brought, slot by slot, and the helpers' power."""
    slots = list(range(1, flight.num_slots + 1))
    rates = flight.rows[["relay_sum_rate", "jamming_sum_rate"]].to_numpy(float).round(4)
    by_mode = [
        _panel(
            4,
            "scatter",
            x=slots,
            y=rates[:, column].tolist(),
            name=name,
            mode="lines",
            line={"color": "#8A8A8A", "width": 1.2, "dash": dash},
            hovertemplate=f"slot %{{x}}: %{{y:.2f}} bps/Hz if {name}<extra></extra>",
        )
        for column, (name, dash) in enumerate((("relaying", "solid"), ("jamming", "6px,4px")))
    ]
    if flight.power_level is None:
        return by_mode
    helpers = names("H", flight.power_level.shape[1])
    dashes = cycle(DASHES.values())
    powers = zip(helpers, flight.power_level.T, dashes, strict=False)
    return [*by_mode, *(_power(slots, *own) for own in powers)]


def _power(slots: list[int], helper: str, level: NDArray[np.float64], dash: str) -> Trace:
    """A helper's power in all slots, a step for each."""
    steps = _panel(
        4,
        "scatter",
        x=slots,
        y=level.round(2).tolist(),
        name=f"power of {helper}",
        mode="lines",
        line={
            "color": OKABE_ITO["reddish purple"],
            "width": 1.6,
            "shape": "hvh",
            "dash": dash,
        },
        hovertemplate=f"{helper}, slot %{{x}}: %{{y:.1f}} dB relative to the nominal power"
        "<extra></extra>",
    )
    return steps | {"yaxis": "y5"}


def _panel(number: int, kind: str, **values: Any) -> Trace:
    """A trace in one of the panels, which the legend leaves out."""
    axes = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
    return trace(kind, **values, **axes, showlegend=False)


def moving_in_panels(scenario: Scenario, flight: Flight, slot: int, color: str) -> list[Trace]:
    """What a slot changes, always as many traces in the same order."""
    return [*_bars(scenario, flight, slot, color), *_sum_rates(flight, slot, color)]


def _bars(scenario: Scenario, flight: Flight, slot: int, color: str) -> list[Trace]:
    """The slot's secrecy rates, and its energies as shares of the budgets."""
    ues = [str(index + 1) for index in range(scenario.num_ues)]
    available = np.array(list(budgets(scenario).values()))
    spent, rates = flight.energy[slot], flight.secrecy_rate[slot].round(4)
    shares = 100 * np.divide(spent, available, out=np.zeros_like(spent), where=available > 0)
    uavs = ["L", *names("H", scenario.num_helpers)]
    units = np.array([1e3] * len(ues) + [1.0] * len(uavs))
    told = [
        f"{unit * value:.4g} of {unit * budget:g} {'J' if unit == 1 else 'mJ'}"
        for value, budget, unit in zip(spent, available, units, strict=True)
    ]
    labelled = scenario.num_ues <= _LABELLED_UES
    rate_texts = [f"{rate:.2f}" if rate else "" for rate in rates]
    energy_texts = [_short(unit * value) for value, unit in zip(spent, units, strict=True)]
    label_style = {"textposition": "outside", "cliponaxis": False, "constraintext": "none"}
    label_style |= {"textangle": 0, "textfont": {"size": 9}}
    return [
        _panel(
            2,
            "bar",
            x=ues,
            y=rates.tolist(),
            name="secrecy rate",
            marker={"color": color},
            text=rate_texts if labelled else None,
            hovertemplate="UE %{x}: %{y:.3f} bps/Hz<extra></extra>",
            **label_style,
        ),
        _panel(
            3,
            "bar",
            x=[*ues, *uavs],
            y=shares.round(2).tolist(),
            name="energy",
            marker={
                "color": ["#8A8A8A"] * len(ues)
                + [LEGITIMATE_COLOR]
                + [color] * scenario.num_helpers
            },
            text=energy_texts if labelled else None,
            customdata=told,
            hovertemplate="%{x}: %{customdata}, %{y:.1f} %<extra></extra>",
            **label_style,
        ),
    ]


def _short(value: float) -> str:
    return f"{value:.1f}" if value < 100 else f"{value:.0f}"


def _sum_rates(flight: Flight, slot: int, color: str) -> list[Trace]:
    """The secrecy sum-rates earned up to the slot, and a mark at the slot."""
    earned = flight.rows["secrecy_sum_rate"].to_numpy(float).round(4)
    return [
        _panel(
            4,
            "bar",
            x=list(range(1, slot + 2)),
            y=earned[: slot + 1].tolist(),
            marker={"color": translucent(color, 0.45)},
            hovertemplate="slot %{x}: %{y:.2f} bps/Hz earned<extra></extra>",
        ),
        _panel(
            4,
            "scatter",
            x=[slot + 1],
            y=[float(earned[slot])],
            mode="markers",
            marker={"size": 11, "color": color, "line": {"color": "white", "width": 1.5}},
            hovertemplate="slot %{x}: %{y:.2f} bps/Hz earned<extra></extra>",
            cliponaxis=False,
        ),
    ]
