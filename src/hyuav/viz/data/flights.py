"""Flights slot by slot: where the helpers were, what each node earned and spent."""

import math
import re
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.evaluation import PER_UE, WAY, helper_columns
from hyuav.experiments.schemes import NO_HELPER
from hyuav.physics.scenario import Point, Scenario
from hyuav.viz.data.schemes import DRAWN, scheme_place

MODE_ROWS = ("proposed", "optimum")
"""The schemes whose helper chooses its mode."""


class Flight(NamedTuple):
    """One flight slot by slot; T slots, U UEs, H helpers."""

    scheme: str
    path: NDArray[np.float64]
    """The starts and the positions in each slot: (T + 1, H, 2) m."""
    relay: NDArray[np.bool_]
    """(T, H)"""
    offloading: NDArray[np.bool_]
    """(T, U)"""
    secrecy_rate: NDArray[np.float64]
    """(T, U) bps/Hz."""
    energy: NDArray[np.float64]
    """Of the UEs, L and the helpers: (T, U + 1 + H) J."""
    way: NDArray[np.int64]
    """How a UE sends if it offloads, 0 straight to L and i through helper i: (T, U)."""
    rows: pd.DataFrame
    """As they were read, a row per slot."""
    power_level: NDArray[np.float64] | None
    """Of each helper, in dB relative to its mode's nominal power: (T, H); None where all are."""

    @property
    def num_slots(self) -> int:
        """T of the flight."""
        return len(self.relay)

    def helpers(self, slot: int) -> list[Point]:
        """Where the helpers are after so many slots, in m."""
        return [(float(x), float(y)) for x, y in self.path[slot]]

    def told_power(self, slot: int) -> list[str]:
        """Of each helper in a slot, counted from 0: " at -3.0 dB", or nothing where nominal."""
        if self.power_level is None:
            return [""] * self.relay.shape[1]
        return [f" at {level:.1f} dB" for level in self.power_level[slot]]

    @property
    def off_map(self) -> NDArray[np.bool_]:
        """Which helpers the map's edge turned back: (T, H)."""
        return self.rows[helper_columns("off_map", self.relay.shape[1])].to_numpy(bool)


def names(letter: str, count: int) -> list[str]:
    """What helpers, H, or eavesdroppers, E, are called: numbered from 1 where there are several."""
    return [letter] if count == 1 else [f"{letter} {number}" for number in range(1, count + 1)]


def told_modes(relay: NDArray[np.bool_], power: Sequence[str] | None = None) -> str:
    """What each helper does in a slot, (H,): "the helper jams", or "H 1 relays, H 2 jams".

    Behind it stands its power, as :meth:`Flight.told_power` gives it.
    """
    if len(relay) > 3:  # too many for a title
        return f"{int(relay.sum())} of {len(relay)} helpers relay"
    who = ["the helper"] if len(relay) == 1 else names("H", len(relay))
    told = zip(who, relay, power or [""] * len(relay), strict=True)
    return ", ".join(f"{name} {'relays' if own else 'jams'}{level}" for name, own, level in told)


def read_flight(scenario: Scenario, flights: pd.DataFrame, scheme: str, episode: int = 0) -> Flight:
    """One of the flights.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`hyuav.experiments.evaluation.Evaluation.flights`.
        scheme: whose flight.
        episode: which of its flights.

    Raises:
        InputError: there is no such flight, or it is not one of this scenario.
    """
    chosen = (flights["scheme"] == scheme) & (flights["episode"] == episode)
    rows = flights[chosen].sort_values("slot")
    if not len(rows):
        pairs = zip(flights["scheme"], flights["episode"], strict=True)
        known = ", ".join(dict.fromkeys(f"{s} {e}" for s, e in pairs)) or "none"
        accepted = f"a scheme and episode of the flights: {known}"
        raise InputError(rejection("flight", f"{scheme} {episode}", accepted))
    _require_fit(scenario, rows, f"{scheme} {episode}")
    columns = partial(helper_columns, num_helpers=scenario.num_helpers)
    lists = {name: list(rows[name]) for name in PER_UE}
    relay = rows[columns("relay")].to_numpy(bool)
    places = np.stack([rows[columns(axis)].to_numpy(float) for axis in "xy"], axis=-1)
    helper_energy = rows[columns("helper_energy")].to_numpy(float)
    of_ues = np.array(lists["ue_energy"], dtype=float)
    offloading = np.array(lists["offloading"], dtype=bool)
    told = set(columns("power_level")) <= set(rows)
    level = rows[columns("power_level")].to_numpy(float) if told else None
    return Flight(
        scheme,
        np.concatenate([np.array([scenario.helper_starts]), places]),
        relay,
        offloading,
        np.array(lists["secrecy_rate"], dtype=float),
        np.hstack([of_ues, rows[["edge_energy"]].to_numpy(float), helper_energy]),
        np.array(list(rows[WAY])) if WAY in rows else relay * np.ones_like(offloading, dtype=int),
        rows,
        level if level is not None and np.isfinite(level).all() else None,
    )


def _require_fit(scenario: Scenario, rows: pd.DataFrame, flight: str) -> None:
    """Accept rows that tell of as many UEs and helpers as the scenario has."""
    if any(len(entry) != scenario.num_ues for name in PER_UE for entry in rows[name]):
        accepted = f"lists with an entry for each of the scenario's {scenario.num_ues} UEs"
        raise InputError(rejection("flights", flight, accepted))
    if (count := num_helpers(rows)) != scenario.num_helpers:
        accepted = f"those of the scenario's {scenario.num_helpers} helpers, not of {count}"
        raise InputError(rejection("flights", flight, accepted))


def num_helpers(flights: pd.DataFrame) -> int:
    """H, by the columns of a table of flights."""
    return max(sum(re.fullmatch("x_[0-9]+", str(name)) is not None for name in flights.columns), 1)


Ends = tuple[Point, Point]
"""Where a link begins and ends, in m."""


class Links(NamedTuple):
    """The links that are alive in a slot."""

    to_legitimate: list[Ends]
    """From each UE that offloads to L, which hears it on either way."""
    to_helper: list[Ends]
    """From each UE that offloads through a helper to that helper."""
    relaying: list[Ends]
    """From each helper through which a UE offloads to L."""
    jamming: list[Ends]
    """From each helper that jams to the eavesdropper that is nearest to it."""


def links(scenario: Scenario, flight: Flight, slot: int) -> Links:
    """Who sends to whom in a slot, counted from 0."""
    helpers, legitimate = flight.helpers(slot + 1), scenario.legitimate_position
    ways = zip(scenario.ue_positions, flight.way[slot], flight.offloading[slot], strict=True)
    senders = [(ue, int(way)) for ue, way, offloads in ways if offloads]
    through = sorted({way for _, way in senders if way})
    jammers = [place for place, relay in zip(helpers, flight.relay[slot], strict=True) if not relay]
    return Links(
        [(ue, legitimate) for ue, _ in senders],
        [(ue, helpers[way - 1]) for ue, way in senders if way],
        [(helpers[way - 1], legitimate) for way in through],
        [
            (place, min(scenario.eavesdropper_positions, key=partial(math.dist, place)))
            for place in jammers
        ],
    )


def flying_schemes(flights: pd.DataFrame) -> list[str]:
    """The schemes in which a helper flies, in the order of every table.

    Args:
        flights: a row per slot, as in :attr:`hyuav.experiments.evaluation.Evaluation.flights`.
    """
    flown = dict.fromkeys(flights["scheme"].astype(str))
    return sorted((scheme for scheme in flown if scheme != NO_HELPER), key=scheme_place)


def first_flights(
    scenario: Scenario, flights: pd.DataFrame, schemes: Iterable[str]
) -> dict[str, Flight]:
    """The first flight of each of the schemes that was flown, in their order.

    Raises:
        InputError: a flight is not one of this scenario.
    """
    flown = set(flights.loc[flights["episode"] == 0, "scheme"])
    return {
        scheme: read_flight(scenario, flights, scheme)
        for scheme in dict.fromkeys(schemes)
        if scheme in flown
    }


def budgets(scenario: Scenario) -> dict[str, float]:
    """What each node may spend in a slot, in J: "UE 1", ..., "L", "H" as in a flight's energy.

    Of several helpers: "H 1", "H 2" and so on.
    """
    return {
        **{f"UE {ue}": scenario.ue_energy_budget for ue in range(1, scenario.num_ues + 1)},
        "L": scenario.edge_energy_budget,
        **dict.fromkeys(names("H", scenario.num_helpers), scenario.helper_energy_budget),
    }


def flight_tables(
    scenario: Scenario, flights: pd.DataFrame, schemes: Iterable[str]
) -> dict[str, pd.DataFrame]:
    """What a map of flights shows.

    Args:
        scenario: that was flown.
        flights: a row per slot; each scheme's first is taken.
        schemes: that are drawn.

    Returns:
        "", the flights: ``scheme``, ``slot`` (0 is the start), ``x`` and ``y`` in m, and whether
        the helper does ``relay``, with its ``power_level`` in dB where that is controlled; of
        several helpers a row for each ``helper``, from 1. "nodes":
        each ``node`` with its ``x`` and ``y`` in m and the ``coverage`` radius in m of L.
    """
    paths = []
    for scheme, flight in first_flights(scenario, flights, schemes).items():
        for number in range(scenario.num_helpers):
            columns = {
                "scheme": scheme,
                "slot": range(flight.num_slots + 1),
                **({"helper": number + 1} if scenario.num_helpers > 1 else {}),
                "x": flight.path[:, number, 0],
                "y": flight.path[:, number, 1],
                "relay": [None, *flight.relay[:, number].tolist()],
            }
            if flight.power_level is not None:
                columns["power_level"] = [np.nan, *flight.power_level[:, number].tolist()]
            paths.append(pd.DataFrame(columns))
    places = {f"UE {ue}": place for ue, place in enumerate(scenario.ue_positions, start=1)}
    eavesdroppers = names("E", scenario.num_eavesdroppers)
    places |= {"L": scenario.legitimate_position}
    places |= dict(zip(eavesdroppers, scenario.eavesdropper_positions, strict=True))
    nodes = pd.DataFrame([(name, *place) for name, place in places.items()])
    nodes.columns = pd.Index(["node", "x", "y"])
    nodes["coverage"] = [scenario.coverage_radius if name == "L" else np.nan for name in places]
    return {"": pd.concat(paths, ignore_index=True), "nodes": nodes}


def energy_table(scenario: Scenario, flights: pd.DataFrame) -> pd.DataFrame:
    """What each node spends in each slot of each scheme's first flight.

    Args:
        scenario: with the budgets.
        flights: a row per slot, as in :attr:`Evaluation.flights`.

    Returns:
        ``scheme``, ``slot``, ``node`` (as in :func:`budgets`), ``energy`` and ``budget`` in J, and
        the ``power_level`` of a helper in dB where that is controlled. L spends in a slot what the
        tasks taken in the slot before need.
    """
    budget = budgets(scenario)
    tables = []
    for flight in first_flights(scenario, flights, DRAWN).values():
        columns = {
            **_slots(flight, len(budget)),
            "node": list(budget) * flight.num_slots,
            "energy": flight.energy.flatten(),
            "budget": list(budget.values()) * flight.num_slots,
        }
        if flight.power_level is not None:
            of_others = np.full((flight.num_slots, scenario.num_ues + 1), np.nan)
            columns["power_level"] = np.hstack([of_others, flight.power_level]).flatten()
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def offloading_table(scenario: Scenario, flights: pd.DataFrame) -> pd.DataFrame:
    """Which UEs offload in each slot of the first flight of each scheme and of the optimum.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`.

    Returns:
        ``scheme``, ``slot``, ``relay`` (whether the helper relays; of several ``relay_1`` and so
        on), ``ue`` (from 1), ``offloading``, and its ``secrecy_rate`` in bps/Hz.
    """
    relays = helper_columns("relay", scenario.num_helpers)
    num_ues, tables = scenario.num_ues, []
    for flight in first_flights(scenario, flights, (*DRAWN, *MODE_ROWS)).values():
        columns = {
            **_slots(flight, num_ues),
            **dict(zip(relays, flight.relay.repeat(num_ues, axis=0).T, strict=True)),
            "ue": np.tile(np.arange(1, num_ues + 1), flight.num_slots),
            "offloading": flight.offloading.flatten(),
            "secrecy_rate": flight.secrecy_rate.flatten(),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def _slots(flight: Flight, rows: int) -> dict[str, Any]:
    """Scheme and slot of a table with so many rows for each slot."""
    slots = np.arange(1, flight.num_slots + 1)
    return {"scheme": flight.scheme, "slot": slots.repeat(rows)}
