"""What an evaluation found, as a table for the terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from hyuav._support.errors import harmless
from hyuav._support.formatting import interval, percent
from hyuav._support.terminal import print_table, results_table
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.schemes import LABELS


def print_results(evaluation: Evaluation, console: Console) -> None:
    """Print the evaluation as a table that fits 80 columns."""
    summary = evaluation.summary
    title = (
        f"{harmless(summary['scenario'])}, T = {summary['num_slots']}: mean of "
        f"{summary['episodes']} episodes on the same fading, 95 % interval"
    )
    table = results_table(
        title,
        "Scheme",
        "Secrecy sum-rate\n(bps/Hz)",
        "own\noptimum",
        "hybrid\noptimum",
        "relay\nslots",
        "UEs off-\nloading",
        "off\nmap",
    )
    for scheme, result in summary["schemes"].items():
        table.add_row(LABELS[scheme], *flight_cells(result))
    print_table(table, console)
    for scheme, result in summary["schemes"].items():
        if result["budget_violations"] > 0:
            count = f"{result['budget_violations']:.2f}"
            console.print(f"{LABELS[scheme]}: {count} energy budgets exceeded per episode")


def flight_cells(result: Mapping[str, Any]) -> tuple[str, ...]:
    """How a scheme flew, as text.

    Args:
        result: of the scheme, in the summary.

    Returns:
        the secrecy sum-rate with its interval, the fractions of the scheme's own and of the hybrid
        optimum, the shares of relay slots and of UEs offloading, and the slots off the map.
    """
    rate = result["secrecy_sum_rate"]
    return (
        interval(rate["mean"], *rate["ci95"]),
        percent(result.get("fraction_of_optimum")),
        percent(result.get("fraction_of_hybrid_optimum")),
        percent(result["relay_share"]),
        percent(result["offloading_share"]),
        f"{result['off_map']:.1f}",
    )
