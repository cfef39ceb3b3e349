"""What was asked for, entry by entry, and in what runs differ."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import pandas as pd

from hyuav.physics.scenario import Scenario

SYMBOLS = {
    f"scenario.{field.name}": " ".join(
        part for part in (field.metadata["symbol"], f"({unit})" if unit else "") if part
    )
    for field in dataclasses.fields(Scenario)
    for unit in [field.metadata["unit"]]
}
"""The symbol and unit of each parameter of the scenario."""

_LONGEST_VALUE = 80


def entries(value: object, name: str) -> list[tuple[str, object]]:
    """Nested values under dotted names.

    Args:
        value: plain, as in ``config.yaml``.
        name: of all of it; "" for none.
    """
    if not isinstance(value, Mapping) or not value:
        return [(name, value)]
    prefix = f"{name}." if name else ""
    return [pair for key, own in value.items() for pair in entries(own, f"{prefix}{key}")]


def differences(configurations: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """The entries of ``config.yaml`` in which runs differ: a row per entry, a column per run."""
    flat = {
        run: {name: _short(value) for name, value in entries(values, "") if name}
        for run, values in configurations.items()
    }
    names = dict.fromkeys(name for values in flat.values() for name in values)
    rows = {
        name: {run: values.get(name, "") for run, values in flat.items()}
        for name in names
        if len({values.get(name) for values in flat.values()}) > 1
    }
    return pd.DataFrame.from_dict(rows, orient="index")


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 1]}…"
