"""What a comparison prints."""

import itertools
import re

import pandas as pd
import pytest
from rich.console import Console

from hyuav.experiments.comparison.statistics import (
    improvements,
    summarize_algorithms,
    summarize_cells,
)
from hyuav.experiments.comparison.summary import Summary
from hyuav.experiments.comparison.tables import label, print_tables, upper_bounds


def printed(algorithms: list[str], capsys: pytest.CaptureFixture[str]) -> list[str]:
    results = pd.DataFrame(
        [
            {
                "algorithm": algorithm,
                "scenario": "two_clusters",
                "scheme": "relay",
                "num_slots": 10,
                "seed": seed,
                "optimum": 59.5,
                "no_helper": 388.3,
                "fraction": 0.9 + 0.01 * place + 0.001 * seed,
                "episodes_to_threshold": 100.0,
                "seconds_to_threshold": 1.0,
                "seconds": 2.0,
                "stopped": float("nan"),
            }
            for (place, algorithm), seed in itertools.product(enumerate(algorithms), range(3))
        ]
    )
    cells = summarize_cells(results, 0.97)
    whole = summarize_algorithms(results, 0.97)
    nothing = pd.DataFrame()
    summary = Summary(results, nothing, cells, whole, nothing, improvements(results))
    print_tables(summary, 0.97, Console(width=200))
    lines = capsys.readouterr().out.splitlines()
    pairs = next(i for i, line in enumerate(lines) if "P(row" in line)
    assert max(len(line.rstrip()) for line in lines) <= 80
    (alone,) = (line for line in lines[:pairs] if line.startswith(" No helper"))
    assert alone.split() == ["No", "helper", "relay", "652.6"]
    return lines[pairs:]


def test_where_the_optimum_is_a_lower_bound_the_upper_one_is_told() -> None:
    one = {"scenario": "two_clusters", "num_slots": 10, "scheme": "relay", "optimum": 7.0}
    results = pd.DataFrame(
        [one, *[one | {"scenario": "contested", "optimum": 400.0, "upper_bound": 496.1}] * 2]
    )
    assert upper_bounds(results) == [
        "contested, T = 10, relay: the optimum is the best flight that was found, 400.00; "
        "no flight earns more than 496.10"
    ]
    assert upper_bounds(results.drop(columns="upper_bound")) == []


def test_few_algorithms_are_set_beside_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(["ddpg_robust", "ddpg", "td3"], capsys)
    (row,) = (line for line in lines if line.startswith(" DDPG  "))
    assert re.findall(r"\d+ %|-", row) == ["100 %", "-", "0 %"]


def test_many_algorithms_are_set_beside_the_first(capsys: pytest.CaptureFixture[str]) -> None:
    pieces = ("clock", "layer_norm", "geofence", "warm_up_episodes", "repeat_every")
    entries = ["ddpg_robust", *(f"ddpg_robust-{piece}" for piece in pieces)]
    lines = printed(entries, capsys)
    for entry in entries[1:]:
        (row,) = (line for line in lines if label(entry) in line)
        assert re.findall(r"\d+ %|-", row) == ["100 %"]
