"""Tables that set runs side by side."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from hyuav.viz.dashboard.curves import OF_THE_RETURN, Choice, learned_label

LAST_EPISODES = 50
"""Over which what a run reached last is averaged."""

_LONGEST_VALUE = 80


def outcomes(metrics: Mapping[str, pd.DataFrame], choice: Choice) -> pd.DataFrame:
    """What each run's learners brought, a row per run, scheme and horizon.

    Args:
        metrics: by the run's name.
        choice: of the quantity.
    """
    rows = []
    unit = " (bps/Hz)" if choice.y in OF_THE_RETURN else ""
    for run, table in metrics.items():
        if choice.y not in table.columns:
            continue
        own = table.dropna(subset=[choice.y, "num_slots"])
        for (scheme, _), learners in own.groupby(["scheme", "num_slots"], sort=False):
            last = learners[learners["episode"] > learners["episode"].max() - LAST_EPISODES]
            means = last.groupby("learner")[choice.y].mean()
            rows.append(
                {
                    "Run": run,
                    "Scheme": learned_label(str(scheme)),
                    "T": int(learners["num_slots"].iloc[0]),
                    "Learners": len(means),
                    "Episode": int(learners["episode"].max()),
                    f"Last {LAST_EPISODES} episodes, mean{unit}": means.mean(),
                    f"Best learner{unit}": means.max(),
                    f"Worst learner{unit}": means.min(),
                }
            )
    return pd.DataFrame(rows).round(3)


def differences(configurations: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """The entries of ``config.yaml`` in which runs differ: a row per entry, a column per run."""
    flat = {run: dict(_flat(values, "")) for run, values in configurations.items()}
    names = dict.fromkeys(name for values in flat.values() for name in values)
    rows = {
        name: {run: values.get(name, "") for run, values in flat.items()}
        for name in names
        if len({values.get(name) for values in flat.values()}) > 1
    }
    return pd.DataFrame.from_dict(rows, orient="index")


def _flat(values: Mapping[str, Any], owner: str) -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{owner}{name}.")
        else:
            yield f"{owner}{name}", _short(value)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 1]}…"
