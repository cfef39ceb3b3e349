"""The flight that the player shows, slot by slot."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from hyuav._support.errors import InputError, rejection
from hyuav.physics.scenario import Scenario


class Flight(NamedTuple):
    """One flight slot by slot; T slots, U UEs."""

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


def read_flight(scenario: Scenario, flights: pd.DataFrame, scheme: str, episode: int) -> Flight:
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
        known = ", ".join(dict.fromkeys(f"{s} {e}" for s, e in _pairs(flights))) or "none"
        accepted = f"a scheme and episode of the flights: {known}"
        raise InputError(rejection("flight", f"{scheme} {episode}", accepted))
    lists = {name: list(rows[name]) for name in ("offloading", "secrecy_rate", "ue_energy")}
    if any(len(entry) != scenario.num_ues for values in lists.values() for entry in values):
        accepted = f"lists with an entry for each of the scenario's {scenario.num_ues} UEs"
        raise InputError(rejection("flights", f"{scheme} {episode}", accepted))
    others = rows[["edge_energy", "helper_energy"]].to_numpy(float)
    return Flight(
        np.vstack([scenario.helper_starts[0], rows[["x", "y"]].to_numpy(float)]).round(2),
        rows["relay"].to_numpy(bool),
        np.array(lists["offloading"], dtype=bool),
        np.array(lists["secrecy_rate"], dtype=float),
        np.hstack([np.array(lists["ue_energy"], dtype=float), others]),
        rows,
    )


def _pairs(flights: pd.DataFrame) -> list[tuple[str, int]]:
    return list(zip(flights["scheme"], flights["episode"], strict=True))
