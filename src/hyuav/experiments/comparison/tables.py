"""The tables that a comparison prints, each within 80 columns."""

from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table

from hyuav._support.errors import harmless
from hyuav._support.formatting import interval, or_never, percent
from hyuav._support.registry import is_reference
from hyuav._support.terminal import print_line, print_table, results_table
from hyuav.experiments.comparison.statistics import NEAR_OPTIMAL
from hyuav.experiments.comparison.summary import Summary
from hyuav.experiments.metrics import finite_numbers
from hyuav.experiments.schemes import GENERALISTS, LABELS, NO_HELPER
from hyuav.learning.registry import GENERALIST, PEER

LABEL_WIDTH = 14
"""Of the column of the algorithms; longer names go on in the next line."""

BESIDE_LABELS = {PEER: "SB3 DDPG", GENERALIST: LABELS[GENERALISTS["hybrid"]]}
"""Of what is compared and no algorithm of this project."""

MOST_COLUMNS = 5
"""Of a table of pairs; where there are more algorithms, each is set beside the first alone."""


def label(entry: str) -> str:
    """An entry's name in tables and figures."""
    if entry in BESIDE_LABELS:
        return BESIDE_LABELS[entry]
    algorithm, _, piece = entry.partition("-")
    if piece:
        return f"without {piece.replace('_', ' ')}"
    if is_reference(algorithm):
        return algorithm.rpartition(":")[2]
    acronym, *rest = algorithm.split("_")
    return " ".join([acronym.upper(), *rest])


def stopped(results: pd.DataFrame) -> list[str]:
    """A line for each learner that stopped for want of finite numbers.

    Args:
        results: a row for each learner, as :meth:`.shards.Shard.tables` gives them; those
            of older comparisons do not tell who stopped.
    """
    if "stopped" not in results:
        return []
    told = results.assign(stopped=finite_numbers(results["stopped"])).dropna(subset="stopped")
    return [
        f"{label(str(row['algorithm']))}, {row['scenario']}, T = {row['num_slots']}, "
        f"{row['scheme']}, seed {row['seed']} stopped in episode {row['stopped']:.0f}, its losses "
        f"or weights not finite; its best weights before that count: {100 * row['fraction']:.1f} % "
        "of the optimum"
        for _, row in told.iterrows()
    ]


def upper_bounds(results: pd.DataFrame) -> list[str]:
    """A line for each cell whose optimum is only the best flight that was found.

    Args:
        results: a row for each learner, as :meth:`.shards.Shard.tables` gives them.
    """
    if not {"upper_bound", "optimum"} <= set(results):
        return []
    numbers = {name: finite_numbers(results[name]) for name in ("upper_bound", "optimum")}
    known = results.assign(**numbers).dropna(subset=[*numbers])
    return [
        f"{scenario}, T = {num_slots}, {scheme}: the optimum is the best flight that was found, "
        f"{own['optimum'].iloc[0]:.2f}; no flight earns more than {own['upper_bound'].iloc[0]:.2f}"
        for (scenario, num_slots, scheme), own in known.groupby(
            ["scenario", "num_slots", "scheme"], sort=False
        )
    ]


def print_tables(summary: Summary, threshold: float, console: Console) -> None:
    """Print the cells of each scenario and horizon, what is told of each algorithm, who stopped.

    Args:
        summary: of the comparison.
        threshold: share of the optimum that counts as solved.
        console: to print on.
    """
    for (scenario, num_slots), cells in summary.cells.groupby(
        ["scenario", "num_slots"], sort=False
    ):
        name = harmless(f"{scenario}, T = {num_slots}")
        print_table(_cells(name, cells, threshold), console)
    print_table(_algorithms("All cells", summary.algorithms, threshold), console)
    if len(summary.layouts) and summary.cells["scenario"].nunique() > 1:
        print_table(_algorithms("Random layouts", summary.layouts, threshold), console)
    if len(summary.improvements):
        print_table(_improvements(summary.improvements), console)
    for line in (*upper_bounds(summary.results), *stopped(summary.results)):
        print_line(line, console)


def _table(title: str, *headings: str) -> Table:
    """One with a row for each algorithm and little room for its name."""
    table = results_table(title, "Algorithm", *headings)
    table.columns[0].max_width, table.columns[0].no_wrap = LABEL_WIDTH, False
    return table


def _cells(name: str, cells: pd.DataFrame, threshold: float) -> Table:
    table = _table(
        f"{name}, % of the optimum: interquartile mean and\n"
        f"95 % interval; medians until {percent(threshold, None)} was reached first",
        *("Scheme", "IQM", "worst", f">= {percent(threshold, None)}", "episodes", "seconds"),
    )
    table.columns[1].justify = "left"
    for scheme, own in cells.groupby("scheme", sort=False):
        for _, cell in own.iterrows():
            table.add_row(
                label(cell["algorithm"]),
                str(scheme),
                _interval(cell),
                f"{100 * cell['worst']:.1f}",
                percent(cell["above_threshold"], 0),
                or_never(cell["median_episodes_to_threshold"], 0),
                or_never(cell["median_seconds_to_threshold"], 1),
            )
        if np.isfinite(own["no_helper"].iloc[0]):
            share = f"{100 * own['no_helper'].mean():.1f}"
            table.add_row(LABELS[NO_HELPER], str(scheme), share, *[""] * 4)
    return table


def _algorithms(name: str, algorithms: pd.DataFrame, threshold: float) -> Table:
    shares = (f">=\n{percent(share, None)}" for share in (NEAR_OPTIMAL, threshold))
    table = _table(
        f"{name}, % of the optimum: interquartile mean and 95 % interval",
        *("lear-\nners", "IQM", "median", "worst", *shares, "seconds"),
    )
    for _, row in algorithms.iterrows():
        table.add_row(
            label(row["algorithm"]),
            f"{row['learners']}",
            _interval(row),
            *(f"{100 * row[column]:.1f}" for column in ("median", "worst")),
            *(percent(row[column], 0) for column in ("near_optimal", "above_threshold")),
            f"{row['seconds']:.1f}",
        )
    return table


def _improvements(improvements: pd.DataFrame) -> Table:
    names = list(dict.fromkeys(improvements["algorithm"]))
    others = names if len(names) <= MOST_COLUMNS else names[:1]
    table = results_table("P(row better than column)", "Algorithm", *map(label, others))
    table.caption = "* 50 % is outside the\n95 % interval"
    table.caption_justify = "left"
    pairs = improvements.set_index(["algorithm", "other"])
    for name in names:
        cells = []
        for other in others:
            if (name, other) not in pairs.index:
                cells.append("-")
                continue
            pair = pairs.loc[(name, other)]
            decided = " " if pair["low"] <= 0.5 <= pair["high"] else "*"
            cells.append(f"{100 * pair['probability']:.0f} %{decided}")
        table.add_row(label(name), *cells)
    return table


def _interval(row: "pd.Series[Any]") -> str:
    return interval(100 * row["iqm"], 100 * row["low"], 100 * row["high"], 1)
