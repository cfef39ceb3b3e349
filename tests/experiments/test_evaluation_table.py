import io
from typing import Any

import pandas as pd
from rich.console import Console

from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.evaluation_table import flight_cells, print_results, upper_bounds

RESULT = {
    "secrecy_sum_rate": {"mean": 59.824, "ci95": [59.661, 59.984]},
    "fraction_of_hybrid_optimum": 0.9994,
    "relay_share": 0.118,
    "offloading_share": 0.79,
    "off_map": 12.04,
    "budget_violations": 0.0,
}


def printed(
    name: str = "square",
    reward: dict[str, str] | None = None,
    scheme: str = "proposed",
    **more: Any,
) -> list[str]:
    schemes = {scheme: RESULT | more}
    summary = {"scenario": name, "num_slots": 20, "episodes": 1000, "schemes": schemes}
    if reward is not None:
        schemes[scheme]["reward"] = {"mean": 1390.85, "ci95": [1389.1, 1392.6]}
        summary["reward"] = reward
    file = io.StringIO()
    print_results(Evaluation(summary, pd.DataFrame()), Console(file=file, width=80))
    return file.getvalue().splitlines()


def test_a_scheme_is_a_row_with_its_interval_within_80_columns() -> None:
    lines = printed()
    row = next(line for line in lines if line.lstrip().startswith("Proposed"))
    assert row.split() == [
        *("Proposed", "59.82", "[59.66,", "59.98]", "-"),
        *("99.9", "%", "11.8", "%", "79.0", "%", "12.0"),
    ]
    assert max(map(len, lines)) <= 80


def test_another_reward_stands_before_the_sum_rate_within_80_columns() -> None:
    told = {"name": "secrecy_energy_efficiency", "unit": "bit/Hz/J"}
    lines = printed(reward=told, fraction_of_optimum=0.98)
    row = next(line for line in lines if line.lstrip().startswith("Proposed"))
    assert row.split() == [
        *("Proposed", "1390.8", "[1389.1,", "1392.6]", "98.0", "%", "59.82"),
        *("11.8", "%", "79.0", "%", "12.0"),
    ]
    assert {"(bit/Hz/J)", "(bps/Hz)"} <= {word for line in lines for word in line.split()}
    assert max(map(len, lines)) <= 80


def test_with_several_helpers_the_share_of_the_upper_bound_stands_beside_that_of_the_lower() -> (
    None
):
    lines = printed(fraction_of_optimum=0.981, upper_bound=65.7, fraction_of_upper_bound=0.911)
    row = next(line for line in lines if line.lstrip().startswith("Proposed"))
    assert row.split()[4:8] == ["98.1", "%", "91.1", "%"]
    assert any(
        line.split() == ["Scheme", "(bps/Hz)", *["bound"] * 2, "slots", "loading", "map"]
        for line in lines
    )
    assert max(map(len, lines)) <= 80


def test_a_scheme_without_an_optimum_of_its_own_has_no_share_of_bounds() -> None:
    assert flight_cells(RESULT, bounded=True)[1:3] == ("-", "-")


def test_upper_bounds_are_told_below_the_table() -> None:
    result = {"upper_bound": 65.7}
    told = upper_bounds({"schemes": {"proposed": result, "optimum": result, "re_optimum": {}}})
    assert told == "no flight exceeds 65.70 (Optimum) bps/Hz"


def test_more_than_a_hundred_and_more_than_ten_times_the_optimum_stay_within_80_columns() -> None:
    rate = {"mean": 771.52, "ci95": [771.28, 771.81]}
    lines = printed(
        scheme="proposed_power",
        secrecy_sum_rate=rate,
        fraction_of_optimum=1.0,
        fraction_of_hybrid_optimum=12.896,
    )
    row = next(line for line in lines if line.lstrip().startswith("Proposed, power"))
    assert row.split()[2:7] == ["771.5", "[771.3,", "771.8]", "100.0", "%"]
    assert row.split()[7:9] == ["1290", "%"]
    assert max(map(len, lines)) <= 80


def test_energy_budgets_that_are_exceeded_are_told() -> None:
    assert "Proposed: 0.50 energy budgets exceeded per episode" in printed(budget_violations=0.5)


def test_a_name_is_no_markup() -> None:
    assert any("[/] [red]x" in line for line in printed("[/] [red]x"))
