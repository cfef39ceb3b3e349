import pandas as pd

from hyuav import Scenario
from hyuav._support.formatting import interval
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.data.reading import readable_evaluation
from hyuav.viz.html.tables import cells_table, configuration_tables, html_table, scheme_table

pytest_plugins = "sample_runs"

HOSTILE = "<script>alert(1)</script> \"a\" 'b'"


def test_whatever_was_read_from_a_file_is_escaped() -> None:
    cells = pd.DataFrame(
        {
            "algorithm": ["ddpg"],
            "scenario": [HOSTILE],
            "scheme": [HOSTILE],
            "num_slots": [20],
            "learners": [1],
            "worst": [0.9],
            "above_threshold": [1.0],
            "iqm": [0.9],
            "low": [0.9],
            "high": [0.9],
            "median_episodes_to_threshold": [float("inf")],
            "median_seconds_to_threshold": [2.0],
            "no_helper": [6.5],
        }
    )
    config = {HOSTILE: {HOSTILE: [HOSTILE, {HOSTILE: HOSTILE}]}, "plain": HOSTILE}
    for table in (
        html_table(HOSTILE, [HOSTILE], [[HOSTILE, HOSTILE]]),
        cells_table(cells, 0.97),
        configuration_tables(config),
    ):
        assert "<script" not in table
        assert "&lt;script&gt;" in table
        assert '"a"' not in table


def test_every_scheme_has_a_row_with_its_interval(evaluated: RunDirectory) -> None:
    summary = readable_evaluation(evaluated.path)
    assert summary is not None
    table = scheme_table(summary)
    for result in summary["schemes"].values():
        rate = result["secrecy_sum_rate"]
        digits = 1 if rate["mean"] >= 100.0 else 2
        low, high = rate["ci95"]
        assert interval(rate["mean"], low, high, digits) in table
    assert table.count("<tr>") == len(summary["schemes"]) + 1


def test_the_scenarios_parameters_have_their_symbols_and_units() -> None:
    scenario = {"name": "custom", **Scenario.preset("two_clusters").to_dict()}
    table = configuration_tables({"scenario": scenario, "seed": 3})
    row = table.split("scenario.coverage_radius")[1].split("</tr>")[0]
    assert "45" in row
    assert "D_max (m)" in row
    assert ">3<" in table.split(">seed<")[1]


def test_nested_entries_are_named_by_dots() -> None:
    table = configuration_tables({"hyperparameters": {"ddpg": {"clock": True, "rate": 0.0003}}})
    assert "hyperparameters.ddpg.clock" in table
    assert "0.0003" in table
