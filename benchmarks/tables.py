"""The tables that the benchmark prints, each within 80 columns."""

from typing import Any

import pandas as pd
from rich.console import Console
from rich.table import Table

from benchmarks.arithmetic import update_flops
from benchmarks.results import Results
from benchmarks.work import Work
from hyuav._support.terminal import print_line, results_table

LABELS = {
    "hyuav": "HyUAV",
    "hyuav_again": "HyUAV, run again",
    "hyuav_robust": "HyUAV robust",
    "stable_baselines3": "Stable-Baselines3",
    "sbx": "SBX",
    "cleanrl": "CleanRL-style",
    "torchrl": "TorchRL loop",
    "make_env": "Environment",
    "compiled_env": "Environment, compiled",
    "random_numbers": "Random draws",
    "numpy": "NumPy",
    "five_schemes": "Evaluating five schemes",
    "optima": "Optima of three mode rules",
}
"""How entries are called in tables and figures."""

HEADINGS = {"learners": "learners", "ues": "UEs", "horizon": "slots"}
VARIED = {"learners": "learners", "ues": "num_ues", "horizon": "num_slots"}
"""By part of the scaling, what is varied: as a heading, and its column."""


def label(row: "pd.Series[Any]") -> str:
    """An entry's name, with its learners unless they are what is varied, and its GPU if any."""
    name = LABELS[row["entry"]]
    if row["learners"] > 1 and row["part"] != "learners":
        name += f", {row['learners']} learners"
    return name if row["device"] == "cpu" else f"{name}, GPU"


def print_tables(results: Results, console: Console) -> None:
    """Print a table for each part that was measured."""
    machine, summary = results.machine, results.summary()
    cores = f"{machine['cores']} cores"
    print_line(f"{machine['processor']}, {cores}, GPU: {machine['gpu']}", console)
    numpy = summary[summary["entry"] == "numpy"]["median"]
    for part, rows in summary.groupby("part", sort=False):
        match part:
            case "training":
                console.print(_training(rows, results), _costs(rows))
            case "environment":
                console.print(_environment(rows, float(numpy.iloc[0])))
            case "job":
                console.print(_job(rows))
            case "references":
                console.print(_references(rows, summary[summary["part"] == "job"]))
            case _:
                console.print(_scaling(rows, str(part)))


def _training(rows: pd.DataFrame, results: Results) -> Table:
    flops = update_flops(int(rows["num_ues"].iloc[0]) + 5, Work.hidden_sizes, Work.batch_size)
    floors = "".join(
        f"\nfloor ({device}): {rate / 1e9:,.0f} GFLOP/s / {flops / 1e6:.1f} MFLOP per update = "
        f"{rate / flops:,.0f} steps/s"
        for device, rate in results.matrix_rates.items()
    )
    title = f"Training: steps of all learners per second, median and range{floors}"
    table = results_table(title, "Entry", "Steps/s", "to SB3", "to SBX", "floor", "threads")
    for _, row in rows.iterrows():
        table.add_row(
            label(row),
            f"{row['median']:.0f} [{row['low']:.0f}, {row['high']:.0f}]",
            _number(row["ratio_to_stable_baselines3"], ".2f"),
            _number(row["ratio_to_sbx"], ".2f"),
            _number(100 * row["share_of_floor"], ".0f", " %"),
            str(row["threads"]),
        )
    return table


def _costs(rows: pd.DataFrame) -> Table:
    title = "Before the first measured step, and the most memory held"
    table = results_table(title, "Entry", "import (s)", "build (s)", "compile, warm (s)", "MiB")
    for _, row in rows.iterrows():
        seconds = (row[f"{name}_seconds"] for name in ("start_up", "build", "warm_up"))
        memory = f"{row['peak_mebibytes']:.0f}"
        table.add_row(label(row), *(f"{value:.1f}" for value in seconds), memory)
    return table


def _environment(rows: pd.DataFrame, numpy: float) -> Table:
    title = f"Environment: slots/s; the NumPy environment flies one helper at {numpy:,.0f}"
    table = results_table(
        title, "Batch", "eager", "x NumPy", "of floor", "compiled", "x NumPy", "of floor", "draws"
    )
    for (device, helpers), group in rows[rows["entry"] != "numpy"].groupby(["device", "helpers"]):
        by_name = group.set_index("entry")
        cells = [f"{helpers:,}" if device == "cpu" else f"{helpers:,} GPU"]
        for name in ("make_env", "compiled_env"):
            if name not in by_name.index:
                cells += ["-"] * 3
                continue
            rate = float(by_name.loc[name, "median"])  # type: ignore[arg-type]
            share = 100 * float(by_name.loc[name, "share_of_floor"])  # type: ignore[arg-type]
            cells += [_short(rate), f"{rate / numpy:.1f}", f"{share:.0f} %"]
        draws = float(by_name.loc["random_numbers", "median"])  # type: ignore[arg-type]
        table.add_row(*cells, _short(draws))
    return table


def _job(rows: pd.DataFrame) -> Table:
    episodes = rows["median"] * rows["seconds"] / rows["num_slots"] / rows["learners"]
    title = f"Whole job: {episodes.iloc[0]:.0f} episodes, start to finish"
    table = results_table(title, "Entry", "seconds", "per learner, to SB3", "MiB")
    for _, row in rows.iterrows():
        table.add_row(
            label(row),
            f"{row['seconds']:.1f}",
            _number(row["ratio_to_stable_baselines3"], ".2f"),
            f"{row['peak_mebibytes']:.0f}",
        )
    return table


def _references(rows: pd.DataFrame, jobs: pd.DataFrame) -> Table:
    table = results_table("Beside a training", "Work", "seconds", "of the whole job")
    job = jobs[jobs["entry"] == "hyuav"]["seconds"]
    for _, row in rows.iterrows():
        share = 100 * row["seconds"] / float(job.iloc[0]) if len(job) else None
        table.add_row(label(row), f"{row['seconds']:.2f}", _number(share, ".0f", " %"))
    return table


def _scaling(rows: pd.DataFrame, part: str) -> Table:
    table = results_table(
        f"Training against the number of {HEADINGS[part]}",
        HEADINGS[part],
        *("Entry", "Steps/s", "to SB3", "of floor", "warm s", "MiB"),
    )
    for _, row in rows.iterrows():
        table.add_row(
            f"{row[VARIED[part]]:,}",
            label(row),
            f"{row['median']:.0f} [{row['low']:.0f}, {row['high']:.0f}]",
            _number(row["ratio_to_stable_baselines3"], ".2f"),
            _number(100 * row["share_of_floor"], ".0f", " %"),
            f"{row['build_seconds'] + row['warm_up_seconds']:.1f}",
            f"{row['peak_mebibytes']:.0f}",
        )
    return table


def _number(value: float | None, form: str, unit: str = "") -> str:
    return "-" if value is None or pd.isna(value) else f"{value:{form}}{unit}"


def _short(value: float) -> str:
    return f"{value / 1e6:.2f} M" if value >= 1e5 else f"{value / 1e3:.1f} k"
