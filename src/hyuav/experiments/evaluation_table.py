"""What an evaluation found, as a table for the terminal."""

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

from rich.console import Console

from hyuav._support.errors import harmless
from hyuav._support.formatting import interval, percent
from hyuav._support.terminal import print_line, print_table, results_table
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.schemes import LABELS, OPTIMA

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
    bounded = is_bounded(summary)
    own = "of lower\nbound" if bounded else "own\noptimum"
    hybrid = "of upper\nbound" if bounded else "hybrid\noptimum"
    beside = "sum-rate\n(bps/Hz)" if "reward" in summary else hybrid
    columns = own, beside, "relay\nslots", "UEs\noff-\nloading", "off\nmap"
    table = results_table(title, "Scheme", earned, *columns)
    for scheme, result in summary["schemes"].items():
        table.add_row(LABELS[scheme], *flight_cells(result, bounded=bounded))
    print_table(table, console)
    if bounded:
        print_line(upper_bounds(summary), console)
    for scheme, result in summary["schemes"].items():
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


def is_bounded(summary: Mapping[str, Any]) -> bool:
    """Whether the optima are lower bounds, beside which upper ones stand: with several helpers."""
    return any("upper_bound" in result for result in summary["schemes"].values())


def upper_bounds(summary: Mapping[str, Any]) -> str:
    """What no flight earns, of each optimum that has an upper bound, in a sentence."""
    schemes = summary["schemes"]
    told = [
        f"{schemes[name]['upper_bound']:.2f} ({LABELS[name]})"
        for name in OPTIMA.values()
        if "upper_bound" in schemes.get(name, {})
    ]
    return f"no flight exceeds {', '.join(told)} bps/Hz"


def earned(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """What a scheme earned by the reward of its evaluation, with the interval."""
    rate: Mapping[str, Any] = result.get("reward", result["secrecy_sum_rate"])
    return rate


def flight_cells(result: Mapping[str, Any], *, bounded: bool) -> tuple[str, ...]:
    """How a scheme flew, as text.

    Args:
        result: of the scheme, in the summary.
        bounded: as :func:`is_bounded` tells of the summary.

    Returns:
        what it earned with its interval, the fraction of the scheme's own optimum, that of the
        hybrid optimum or, where ``bounded``, of the upper bound of the scheme's own or, where
        another reward was earned, the secrecy sum-rate, the shares of relay slots and of UEs
        offloading, and the slots off the map. A fraction of what a scheme does not have is "-".
    """
    rate = earned(result)
    mean, (low, high) = rate["mean"], rate["ci95"]
    digits = 1 if abs(mean) >= 100.0 else 2
    share = result.get("fraction_of_upper_bound" if bounded else "fraction_of_hybrid_optimum")
    beside = percent(share, 1 if share is None or share < 10.0 else 0)
    return (
        interval(mean, low, high, digits),
        percent(result.get("fraction_of_optimum")),
        f"{result['secrecy_sum_rate']['mean']:.2f}" if "reward" in result else beside,
        percent(result["relay_share"]),
        percent(result["offloading_share"]),
        f"{result['off_map']:.1f}",
    )
