"""What an evaluation found, as a table for the terminal."""

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

from rich.console import Console

from hyuav._support.errors import harmless
from hyuav._support.formatting import interval, percent
from hyuav._support.terminal import print_table, results_table
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.schemes import LABELS

WIDTH = 18
"""Of the heading of what is earned."""


def print_results(evaluation: Evaluation, console: Console) -> None:
    """Print the evaluation as a table that fits 80 columns."""
    summary = evaluation.summary
    title = (
        f"{harmless(summary['scenario'])}, T = {summary['num_slots']}: mean of "
        f"{summary['episodes']} episodes on the same fading, 95 % interval"
    )
    earned = "\n".join(wrap(earned_title(summary), WIDTH, break_on_hyphens=False))
    beside = "sum-rate\n(bps/Hz)" if "reward" in summary else "hybrid\noptimum"
    columns = "own\noptimum", beside, "relay\nslots", "UEs\noff-\nloading", "off\nmap"
    table = results_table(title, "Scheme", earned, *columns)
    for scheme, result in summary["schemes"].items():
        table.add_row(LABELS[scheme], *flight_cells(result))
    print_table(table, console)
    for scheme, result in summary["schemes"].items():
        if (bound := result.get("upper_bound")) is not None:
            console.print(f"{LABELS[scheme]}: no flight is expected to earn more than {bound:.2f}")
        if result["budget_violations"] > 0:
            count = f"{result['budget_violations']:.2f}"
            console.print(f"{LABELS[scheme]}: {count} energy budgets exceeded per episode")


def earned_title(summary: Mapping[str, Any]) -> str:
    """What is earned, with its unit: the secrecy sum-rate, or the reward of an evaluation."""
    if "reward" not in summary:
        return "Secrecy sum-rate (bps/Hz)"
    name, unit = (harmless(str(summary["reward"][part])) for part in ("name", "unit"))
    title = name.rpartition(":")[2].replace("_", " ").capitalize()
    return f"{title} ({unit})" if unit else title


def flight_cells(result: Mapping[str, Any]) -> tuple[str, ...]:
    """How a scheme flew, as text.

    Args:
        result: of the scheme, in the summary.

    Returns:
        what it earned with its interval, the fraction of the scheme's own optimum, that of the
        hybrid optimum or, where another reward was earned, the secrecy sum-rate, the shares of
        relay slots and of UEs offloading, and the slots off the map.
    """
    rate = result.get("reward", result["secrecy_sum_rate"])
    mean, (low, high) = rate["mean"], rate["ci95"]
    digits = 1 if abs(mean) >= 100.0 else 2
    share = result.get("fraction_of_hybrid_optimum")
    hybrid = percent(share, 1 if share is None or share < 10.0 else 0)
    return (
        interval(mean, low, high, digits),
        percent(result.get("fraction_of_optimum")),
        f"{result['secrecy_sum_rate']['mean']:.2f}" if "reward" in result else hybrid,
        percent(result["relay_share"]),
        percent(result["offloading_share"]),
        f"{result['off_map']:.1f}",
    )
