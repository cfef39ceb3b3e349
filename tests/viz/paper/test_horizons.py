from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from hyuav.experiments.evaluation import Evaluation
from hyuav.viz.data.runs import horizon_table
from hyuav.viz.data.schemes import COLORS
from hyuav.viz.paper.horizons import sum_rates_by_horizon


def summaries(evaluation: Evaluation) -> list[dict[str, Any]]:
    """The same results over two horizons, where Ja-LT is too fast for the shorter."""
    shorter = evaluation.summary | {"num_slots": 4}
    kept = {name: own for name, own in shorter["schemes"].items() if name != "ja_lt"}
    return [evaluation.summary, shorter | {"schemes": kept}]


def bars_of(figure: Figure) -> list[ErrorbarContainer]:
    """The curves with intervals, in the order in which they were drawn, those above first."""
    drawn = [own for axes in figure.axes for own in axes.containers]
    return [own for own in drawn if isinstance(own, ErrorbarContainer)]


def test_the_table_has_a_row_for_each_scheme_and_horizon_in_order(evaluation: Evaluation) -> None:
    table = horizon_table(summaries(evaluation))
    assert table["num_slots"].tolist() == [4] * 6 + [10] * 7
    assert table[table["scheme"] == "ja_lt"]["num_slots"].tolist() == [10]
    row = table[(table["scheme"] == "re_lt") & (table["num_slots"] == 10)].iloc[0]
    expected = evaluation.summary["schemes"]["re_lt"]["secrecy_sum_rate"]
    assert [row["mean"], [row["low"], row["high"]]] == [expected["mean"], expected["ci95"]]


def test_every_scheme_and_every_optimum_has_a_curve_with_intervals(
    evaluation: Evaluation,
) -> None:
    table = horizon_table(summaries(evaluation))
    figure = sum_rates_by_horizon(table)
    drawn = {str(own.get_label()): own for own in bars_of(figure)}
    optima = ["Optimum", "Ja-optimum", "Re-optimum"]
    assert list(drawn) == ["No helper", *optima, "Proposed", "Re-LT", "Ja-LT"]
    for label, scheme in (("Re-LT", "re_lt"), ("Ja-optimum", "ja_optimum")):
        line, _, (bars,) = drawn[label]
        own = table[table["scheme"] == scheme]
        np.testing.assert_allclose(np.asarray(line.get_ydata(), dtype=float), own["mean"])
        ends = [np.asarray(segment)[:, 1].astype(float) for segment in bars.get_segments()]
        np.testing.assert_allclose(ends, own[["low", "high"]])
    dotted = [drawn[name].lines[0] for name in optima]
    assert [to_hex(line.get_color()).upper() for line in dotted] == [
        COLORS[name] for name in ("proposed", "ja_ot", "re_ot")
    ]


def test_no_bar_hides_another_and_all_stand_by_their_horizon(evaluation: Evaluation) -> None:
    figure = sum_rates_by_horizon(horizon_table(summaries(evaluation)))
    places = [np.asarray(own.lines[0].get_xdata(), dtype=float) for own in bars_of(figure)]
    assert len({own[-1] for own in places[1:]}) == len(places) - 1
    assert places[0].tolist() == [4, 10]  # which has the upper axes for itself
    assert max(abs(own[-1] - 10) for own in places) < 1.0


def test_no_helper_stands_above_a_break_where_it_would_squash_the_papers_schemes(
    evaluation: Evaluation,
) -> None:
    table = horizon_table(summaries(evaluation))
    upper, lower = sum_rates_by_horizon(table).axes
    is_alone = table["scheme"] == "no_helper"
    alone, others = table[is_alone]["mean"], table[~is_alone]["mean"]
    assert upper.get_ylim()[0] < alone.min() <= alone.max() < upper.get_ylim()[1]
    assert others.max() < lower.get_ylim()[1] < 2 * others.max()
    poor = table.copy()
    poor.loc[is_alone, ["mean", "low", "high"]] = others.max()
    whole = sum_rates_by_horizon(poor)
    assert len(whole.axes) == 1
    assert "No helper" in {own.get_label() for own in bars_of(whole)}
