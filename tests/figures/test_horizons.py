from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from hyuav.evaluation import Evaluation
from hyuav.figures import COLORS
from hyuav.figures.horizons import horizon_table, sum_rates_by_horizon


def summaries(evaluation: Evaluation) -> list[dict[str, Any]]:
    """The same results over two horizons, where Ja-LT is too fast for the shorter."""
    shorter = evaluation.summary | {"num_slots": 4}
    kept = {name: own for name, own in shorter["schemes"].items() if name != "ja_lt"}
    return [evaluation.summary, shorter | {"schemes": kept}]


def test_the_table_has_a_row_for_each_scheme_and_horizon_in_order(evaluation: Evaluation) -> None:
    table = horizon_table(summaries(evaluation))
    assert table["num_slots"].tolist() == [4] * 5 + [10] * 6
    assert table[table["scheme"] == "ja_lt"]["num_slots"].tolist() == [10]
    row = table[(table["scheme"] == "re_lt") & (table["num_slots"] == 10)].iloc[0]
    expected = evaluation.summary["schemes"]["re_lt"]["secrecy_sum_rate"]
    assert [row["mean"], [row["low"], row["high"]]] == [expected["mean"], expected["ci95"]]


def test_every_scheme_has_a_curve_with_intervals_and_every_optimum_a_line(
    evaluation: Evaluation,
) -> None:
    table = horizon_table(summaries(evaluation))
    figure = sum_rates_by_horizon(table)
    (axes,) = figure.axes
    drawn = {str(container.get_label()): container for container in axes.containers}
    assert list(drawn) == ["Proposed", "Re-LT", "Ja-LT"]
    line, _, (bars,) = drawn["Re-LT"]
    own = table[table["scheme"] == "re_lt"]
    np.testing.assert_allclose(np.asarray(line.get_ydata(), dtype=float), own["mean"])
    ends = [np.asarray(segment)[:, 1].astype(float) for segment in bars.get_segments()]
    np.testing.assert_allclose(ends, own[["low", "high"]])
    optima = [line for line in axes.lines if line.get_marker() == "None"]
    assert [to_hex(line.get_color()).upper() for line in optima] == [
        COLORS[name] for name in ("proposed", "ja_ot", "re_ot")
    ]
