"""The flight player: a map with a slot slider, and each slot's links, rates and energies."""

from typing import Any

import pandas as pd
import plotly.graph_objects as go

from hyuav.physics.scenario import Scenario
from hyuav.viz.data.flights import Flight, read_flight, told_modes
from hyuav.viz.data.schemes import scheme_color, scheme_label
from hyuav.viz.html.player_layout import animation_controls, layouts, power_axis, rearranged
from hyuav.viz.html.player_map import fixed_on_map, moving_on_map
from hyuav.viz.html.player_panels import fixed_in_panels, highest, moving_in_panels
from hyuav.viz.html.style import base_layout, plain


def flight_player(
    scenario: Scenario,
    flights: pd.DataFrame,
    scheme: str,
    episode: int = 0,
    *,
    narrow: bool = False,
) -> go.Figure:
    """A flight slot by slot, moved by a slider or played.

    The map shows the path flown so far (relaying solid, jamming dashed), which UEs offload
    (filled), the links that are alive and the coverage that counts; beside it stand the slot's
    secrecy rates, its energies as shares of the budgets, and the sum-rates of all slots, with the
    helpers' power where that is chosen.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`hyuav.experiments.evaluation.Evaluation.flights`.
        scheme: whose flight is shown.
        episode: which of its flights.
        narrow: whether the panels stand below the map, as for a phone, and not beside it. The
            figure's ``layout.meta`` holds what to change for ``wide`` and ``narrow``.

    Raises:
        InputError: there is no such flight, or it is not one of this scenario.
    """
    return go.Figure(plain_player(scenario, flights, scheme, episode, narrow=narrow))


def plain_player(
    scenario: Scenario,
    flights: pd.DataFrame,
    scheme: str,
    episode: int = 0,
    *,
    narrow: bool = False,
) -> dict[str, Any]:
    """The same in plain values, which no Plotly has checked: that takes most of the time.

    Args:
        scenario: that was flown.
        flights: as :func:`flight_player` takes them.
        scheme: whose flight is shown.
        episode: which of its flights.
        narrow: whether the panels stand below the map.

    Raises:
        InputError: there is no such flight, or it is not one of this scenario.
    """
    flight = read_flight(scenario, flights, scheme, episode)
    color, num_slots = scheme_color(scheme), flight.num_slots
    fixed = [*fixed_on_map(scenario, flight), *fixed_in_panels(flight)]
    moving = [
        [
            *moving_on_map(scenario, flight, slot, color),
            *moving_in_panels(scenario, flight, slot, color),
        ]
        for slot in range(num_slots)
    ]
    titles = [{"title": {"text": _title(flight, slot)}} for slot in range(num_slots)]
    frames = [
        {
            "name": str(slot + 1),
            "data": moving[slot],
            "traces": list(range(len(fixed), len(fixed) + len(moving[slot]))),
            "layout": titles[slot],
        }
        for slot in range(num_slots)
    ]
    layout = _layout(scenario, flight, narrow=narrow)
    layout["title"] |= titles[0]["title"]
    return {"data": [*fixed, *moving[0]], "layout": layout, "frames": frames}


def _layout(scenario: Scenario, flight: Flight, *, narrow: bool) -> dict[str, Any]:
    """All but the title's text."""
    both = layouts(scenario, flight.num_slots, highest(flight))
    layout = base_layout() | animation_controls(flight.num_slots) | both["shared"]
    if flight.power_level is not None:
        layout |= power_axis(scenario)
    layout["meta"] = {name: both[name] for name in ("wide", "narrow")}
    return rearranged(layout, both["narrow" if narrow else "wide"])


def _title(flight: Flight, slot: int) -> str:
    """What a person reads of the slot, on two lines."""
    row, relay = flight.rows.iloc[slot], flight.relay[slot]
    count, total = int(flight.offloading[slot].sum()), flight.offloading.shape[1]
    name, told = plain(scheme_label(flight.scheme)), flight.told_power(slot)
    one = ("relay" if relay.all() else "jamming") + told[0]
    mode = one if len(relay) == 1 else told_modes(relay, told)
    off_map = ", turned back at the edge" if flight.off_map[slot].any() else ""
    return (
        f"<b>{name}, slot {slot + 1} of {flight.num_slots}: {mode}</b>{off_map}"
        f"<br>{count} of {total} UEs offload, {row['secrecy_sum_rate']:.2f} bps/Hz"
    )
