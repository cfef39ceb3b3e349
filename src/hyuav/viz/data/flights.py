"""Flights slot by slot: where the helper was, what each node earned and spent."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.schemes import NO_HELPER
from hyuav.physics.scenario import Point, Scenario
from hyuav.viz.data.schemes import DRAWN, scheme_place

MODE_ROWS = ("proposed", "optimum")
"""The schemes whose helper chooses its mode."""


class Flight(NamedTuple):
    """One flight slot by slot; T slots, U UEs."""

    scheme: str
    path: NDArray[np.float64]
    """The start and the position in each slot: (T + 1, 2) m."""
    relay: NDArray[np.bool_]
    """(T,)"""
    offloading: NDArray[np.bool_]
    """(T, U)"""
    secrecy_rate: NDArray[np.float64]
    """(T, U) bps/Hz."""
    energy: NDArray[np.float64]
    """Of the UEs, L and H: (T, U + 2) J."""
    rows: pd.DataFrame
    """As they were read, a row per slot."""
    power_level: NDArray[np.float64] | None
    """Of the helper, in dB relative to its mode's nominal power: (T,); None where it is nominal."""

    @property
    def num_slots(self) -> int:
        """T of the flight."""
        return len(self.relay)

    def helper(self, slot: int) -> Point:
        """Where the helper is after so many slots, in m."""
        return float(self.path[slot, 0]), float(self.path[slot, 1])


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
    lists = {name: list(rows[name]) for name in ("offloading", "secrecy_rate", "ue_energy")}
    if any(len(entry) != scenario.num_ues for values in lists.values() for entry in values):
        accepted = f"lists with an entry for each of the scenario's {scenario.num_ues} UEs"
        raise InputError(rejection("flights", f"{scheme} {episode}", accepted))
    others = rows[["edge_energy", "helper_energy"]].to_numpy(float)
    level = rows["power_level"].to_numpy(float) if "power_level" in rows else None
    return Flight(
        scheme,
        np.vstack([scenario.helper_starts[0], rows[["x", "y"]].to_numpy(float)]),
        rows["relay"].to_numpy(bool),
        np.array(lists["offloading"], dtype=bool),
        np.array(lists["secrecy_rate"], dtype=float),
        np.hstack([np.array(lists["ue_energy"], dtype=float), others]),
        rows,
        level if level is not None and np.isfinite(level).all() else None,
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
    """What each node may spend in a slot, in J: "UE 1", ..., "L", "H" as in a flight's energy."""
    return {
        **{f"UE {ue}": scenario.ue_energy_budget for ue in range(1, scenario.num_ues + 1)},
        "L": scenario.edge_energy_budget,
        "H": scenario.helper_energy_budget,
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
        the helper does ``relay``, with its ``power_level`` in dB where that is controlled; "nodes":
        each ``node`` with its ``x`` and ``y`` in m and the ``coverage`` radius in m of L.
    """
    paths = []
    for scheme, flight in first_flights(scenario, flights, schemes).items():
        columns = {
            "scheme": scheme,
            "slot": range(flight.num_slots + 1),
            "x": flight.path[:, 0],
            "y": flight.path[:, 1],
            "relay": [None, *flight.relay.tolist()],
        }
        if flight.power_level is not None:
            columns["power_level"] = [np.nan, *flight.power_level.tolist()]
        paths.append(pd.DataFrame(columns))
    places = {f"UE {ue}": place for ue, place in enumerate(scenario.ue_positions, start=1)}
    places |= {"L": scenario.legitimate_position, "E": scenario.eavesdropper_positions[0]}
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
        ``scheme``, ``slot``, ``node`` ("UE 1", ..., "L", "H"), ``energy`` and ``budget`` in J, and
        the ``power_level`` of H in dB where it is controlled. L spends in a slot what the tasks
        taken in the slot before need.
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
            columns["power_level"] = flight.power_level.repeat(len(budget))
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def offloading_table(scenario: Scenario, flights: pd.DataFrame) -> pd.DataFrame:
    """Which UEs offload in each slot of the first flight of each scheme and of the optimum.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`.

    Returns:
        ``scheme``, ``slot``, ``relay`` (whether the helper relays), ``ue`` (from 1),
        ``offloading``, and its ``secrecy_rate`` in bps/Hz.
    """
    num_ues, tables = scenario.num_ues, []
    for flight in first_flights(scenario, flights, (*DRAWN, *MODE_ROWS)).values():
        columns = {
            **_slots(flight, num_ues),
            "relay": flight.relay.repeat(num_ues),
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
