"""From measurements to medians, ranges, ratios and shares of the floor; the files that are kept."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.arithmetic import update_flops
from benchmarks.measure import Row
from benchmarks.work import Work
from hyuav._support.files import write_durably

IDENTITY = ["part", "entry", "device", "learners", "helpers", "num_ues", "num_slots", "threads"]
"""Columns in which measurements of the same thing agree; they differ in the round."""

RATIOS = {"ratio_to_stable_baselines3": "stable_baselines3", "ratio_to_sbx": "sbx"}
FACTS = (
    *("start_up_seconds", "build_seconds", "warm_up_seconds"),
    *("peak_mebibytes", "peak_gpu_mebibytes"),
)
"""What is told of an entry's process beside its rates."""

TRAINING = ("training", "learners", "ues", "horizon")
"""Parts whose steps are training steps."""


@dataclass
class Results:
    """All that one run measured.

    ``measurements`` has a row for each entry and round. ``summary`` has a row for each entry:
    the ``median`` of its steps/s with its range ``low`` to ``high`` over the rounds, ratios of
    medians, and the share of the arithmetic or random-number floor.
    """

    machine: dict[str, Any]
    matrix_rates: dict[str, float]
    """Best floating-point operations per second in matrix products, by device."""
    rows: list[Row]

    @property
    def measurements(self) -> pd.DataFrame:
        """As they came."""
        return pd.DataFrame(self.rows)

    def summary(self) -> pd.DataFrame:
        """As described above."""
        rows = self.measurements.reindex(
            columns=[*IDENTITY, "round", "steps", "seconds", "steps_per_second", *FACTS]
        )
        groups = rows.groupby(IDENTITY, sort=False, as_index=False)
        summary = groups.agg(
            median=("steps_per_second", "median"),
            low=("steps_per_second", "min"),
            high=("steps_per_second", "max"),
            seconds=("seconds", "median"),
            **{fact: (fact, "max") for fact in FACTS},
        )
        summary = _keep_best_threads(summary)
        for column, peer in RATIOS.items():
            summary[column] = [_ratio(summary, row, peer) for _, row in summary.iterrows()]
        summary["floor"] = [self._floor(summary, row) for _, row in summary.iterrows()]
        summary["share_of_floor"] = summary["median"] / summary["floor"]
        return summary

    def _floor(self, summary: pd.DataFrame, row: "pd.Series[Any]") -> float | None:
        """Steps/s that nothing on this machine could exceed: by DDPG's arithmetic, or by draws."""
        if row["part"] in TRAINING and row["entry"] != "hyuav_robust":
            flops = update_flops(row["num_ues"] + 5, Work.hidden_sizes, Work.batch_size)
            return self.matrix_rates[row["device"]] / flops
        if row["part"] == "environment" and row["entry"] != "numpy":
            same = summary["entry"] == "random_numbers"
            for column in ("part", "device", "helpers"):
                same &= summary[column] == row[column]
            return float(summary[same]["median"].iloc[0])
        return None

    def save(self, directory: Path) -> None:
        """Write ``benchmark.json`` and, measurement by measurement, ``benchmark.parquet``."""
        write_durably(directory / "benchmark.parquet", self.measurements.to_parquet())
        content = {
            "machine": self.machine,
            "matrix_rates": self.matrix_rates,
            "summary": json.loads(self.summary().to_json(orient="records")),
        }
        text = json.dumps(content, indent=2)
        write_durably(directory / "benchmark.json", f"{text}\n".encode())


def _keep_best_threads(summary: pd.DataFrame) -> pd.DataFrame:
    """Of entries measured with several numbers of threads, the fastest."""
    identity = [column for column in IDENTITY if column != "threads"]
    best = summary.groupby(identity, sort=False)["median"].idxmax()
    return summary.loc[sorted(best)].reset_index(drop=True)


def _ratio(summary: pd.DataFrame, row: "pd.Series[Any]", peer: str) -> float | None:
    """How many times as fast as the peer at the same work, where it was measured."""
    same = summary["entry"] == peer
    for column in ("part", "num_ues", "num_slots"):
        same &= summary[column] == row[column]
    rates = summary[same]["median"]
    return float(row["median"] / rates.iloc[0]) if len(rates) else None
