"""Read what a directory holds, as far as it can be read: it may be unfinished or damaged."""

import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hyuav._support.errors import InputError
from hyuav._support.files import read_parquet
from hyuav._support.yaml_files import read_yaml
from hyuav.envs.rewards import REWARDS, SUM_RATE
from hyuav.experiments.evaluation import (
    EVALUATION_FILE,
    FLIGHTS_FILE,
    PER_UE,
    WAY,
    helper_columns,
)
from hyuav.experiments.evaluation_table import earned
from hyuav.experiments.schemes import LABELS, NO_HELPER, OPTIMA
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.flights import num_helpers

_FLIGHT_COLUMNS = {
    *("scheme", "episode", "slot", "secrecy_sum_rate"),
    *("relay_sum_rate", "jamming_sum_rate", "edge_energy"),
    *PER_UE,
}
_OF_HELPERS = "x", "y", "relay", "off_map", "helper_energy"
_ACCOUNT = {"relay_share", "offloading_share", "off_map", "budget_violations"} | {
    *("ue_energy", "edge_energy", "helper_energy")
}


def readable_config(directory: Path) -> dict[str, Any]:
    """The directory's ``config.yaml``; empty where there is none that can be read."""
    try:
        return read_yaml(directory / "config.yaml")
    except InputError:
        return {}


def read_evaluation(directory: Path) -> dict[str, Any]:
    """The content of ``evaluation.json``.

    Raises:
        InputError: there is none, or it is damaged or another program's.
    """
    file = _existing(directory, EVALUATION_FILE)
    content = readable_evaluation(directory)
    if content is None:
        raise InputError(f"{file}: expected an evaluation in JSON (`hyuav evaluate` makes it)")
    return content


def _existing(directory: Path, name: str) -> Path:
    file = directory / name
    if not file.exists():
        raise InputError(f"there is no {name} in {directory} (`hyuav evaluate` makes it)")
    return file


def readable_evaluation(directory: Path) -> dict[str, Any] | None:
    """The content of ``evaluation.json``; None where there is none that can be read."""
    if not (directory / EVALUATION_FILE).is_file():  # a pipe would be waited for
        return None
    try:
        content = json.loads((directory / EVALUATION_FILE).read_text(encoding="utf-8"))
        accounts = list(content["schemes"].values())
        complete = all(_is_account(account) for account in accounts)
        reward = content.get("reward")
        told = reward is None or {"name", "unit"} <= set(reward)
        complete = complete and told and all(("reward" in own) == bool(reward) for own in accounts)
        whole = all(type(content[name]) is int for name in ("num_slots", "episodes"))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    return content if complete and whole else None


def _is_account(account: dict[str, Any]) -> bool:
    if type(account["learners"]) is not int:
        return False
    needed = [account[name] for name in _ACCOUNT]
    for rate in (account["secrecy_sum_rate"], account.get("reward")):
        if rate is not None:
            low, high = rate["ci95"]
            needed += [rate["mean"], low, high]
    fractions = ("optimum", "hybrid_optimum", "upper_bound")
    optional = [account.get(f"fraction_of_{name}", 0.0) for name in fractions]
    optional.append(account.get("upper_bound", 0.0))
    return all(
        isinstance(value, int | float) and abs(value) <= sys.float_info.max
        for value in needed + optional
    )


def unit_of(config: Mapping[str, Any]) -> str:
    """Of the reward that a configuration names; empty where that is not known here."""
    name = config.get("reward", SUM_RATE)
    known = REWARDS.get(name) if isinstance(name, str) else None
    return "" if known is None else known.unit


def references_of(evaluation: Mapping[str, Any]) -> dict[str, float]:
    """What learners are set beside, by the reward, as far as it was evaluated.

    Returns:
        what the best flight earns by mode rule, and under :data:`NO_HELPER` what comes without one.
    """
    results = evaluation["schemes"]
    return {
        name: float(earned(results[scheme])["mean"])
        for name, scheme in {**OPTIMA, NO_HELPER: NO_HELPER}.items()
        if scheme in results
    }


def read_flights(directory: Path) -> pd.DataFrame:
    """The rows of ``flights.parquet``.

    Raises:
        InputError: there are none, or they are damaged or another program's.
    """
    file, accepted = _existing(directory, FLIGHTS_FILE), "the flights of an evaluation"
    if not file.is_file():
        raise InputError(f"{file}: expected {accepted} in Parquet (not a file)")
    table = read_parquet(file, accepted)
    missing = ", ".join(sorted(_flight_columns(table) - set(table.columns)))
    if missing or table.empty:
        raise InputError(f"{file}: expected {accepted} in Parquet (with {missing or 'rows'})")
    if not _is_flown(table):
        raise InputError(f"{file}: expected {accepted} in Parquet (of finite numbers)")
    return table


def readable_flights(directory: Path) -> pd.DataFrame | None:
    """The rows of ``flights.parquet``; None where there are none that can be read."""
    try:
        return read_flights(directory)
    except InputError:
        return None


def _flight_columns(table: pd.DataFrame) -> set[str]:
    """What flights of so many helpers as the table's have in any case."""
    count = num_helpers(table)
    of_helpers = {column for name in _OF_HELPERS for column in helper_columns(name, count)}
    return _FLIGHT_COLUMNS | of_helpers | ({WAY} if count > 1 else set())


def _is_flown(table: pd.DataFrame) -> bool:
    """Whether all that is drawn of flights are finite numbers, a list of them for the UEs."""
    columns = _flight_columns(table)
    lists = columns & {*PER_UE, WAY}
    numbers = sorted(columns - lists - {"scheme"})
    try:
        drawn = [table[numbers].to_numpy(float).ravel()]
        drawn += [np.asarray(own, dtype=float) for name in lists for own in table[name]]
    except (TypeError, ValueError, OverflowError):
        return False
    return all(own.ndim == 1 and np.isfinite(own).all() for own in drawn)


def is_drawable(flights: pd.DataFrame, scenario: Scenario) -> bool:
    """Whether flights are of known schemes, some at least, and of as many UEs and helpers."""
    known = [isinstance(scheme, str) and scheme in LABELS for scheme in flights["scheme"]]
    count = num_helpers(flights)
    lists = PER_UE if count == 1 else (*PER_UE, WAY)
    whole = all(len(own) == scenario.num_ues for name in lists for own in flights[name])
    return any(known) and whole and count == scenario.num_helpers


def readable_table(path: Path, columns: Iterable[str]) -> pd.DataFrame | None:
    """A Parquet file with at least these columns; None where it is none, yet, or has no rows."""
    if not path.is_file():
        return None
    try:
        table = read_parquet(path, "a table")
    except InputError:
        return None
    return table if len(table) and set(columns) <= set(table.columns) else None
