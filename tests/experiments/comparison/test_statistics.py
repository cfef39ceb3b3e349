"""The statistics of a comparison against numbers worked out by hand and by brute force."""

import itertools
import math

import numpy as np
import pandas as pd
import pytest

from hyuav.experiments.comparison.statistics import (
    LAYOUTS,
    improvements,
    in_cells,
    learning_curves,
    performance_profiles,
    probability_of_improvement,
    summarize_algorithms,
    summarize_cells,
)
from hyuav.experiments.intervals import Array


def learners(algorithm: str, fractions: list[float], scenario: str = "random_disk") -> pd.DataFrame:
    """One cell; a learner that reaches 97 % did so after 10, 20, ... episodes, in as many s."""
    episodes = [10.0 * (n + 1) if f >= 0.97 else np.nan for n, f in enumerate(fractions)]
    return pd.DataFrame(
        {
            "algorithm": algorithm,
            "scenario": scenario,
            "scheme": "hybrid",
            "num_slots": 20,
            "seed": range(len(fractions)),
            "fraction": fractions,
            "episodes_to_threshold": episodes,
            "seconds_to_threshold": episodes,
            "seconds": 60.0,
        }
    )


def normal(*shape: int) -> Array:
    return np.random.default_rng(0).standard_normal(shape)


def test_the_probability_of_improvement_counts_pairs() -> None:
    ones, low, high = np.ones(3), np.array([1.0, 2.0]), np.array([3.0, 4.0, 5.0])
    assert probability_of_improvement(high, low) == 1.0
    assert probability_of_improvement(low, high) == 0.0
    assert probability_of_improvement(ones, ones) == 0.5
    x, y = normal(20).round(1), normal(2, 30)[1].round(1)
    counted = [float(a > b) + 0.5 * (a == b) for a, b in itertools.product(x, y)]
    assert probability_of_improvement(x, y) == pytest.approx(np.mean(counted))


def test_a_cell_is_summarized() -> None:
    (cell,) = summarize_cells(learners("ddpg", [0.9, 0.97, 0.98, 1.0]), 0.97).to_dict("records")
    assert cell["iqm"] == pytest.approx(0.975)
    assert 0.9 <= cell["low"] < cell["iqm"] < cell["high"] <= 1.0
    assert cell["worst"] == 0.9
    assert cell["above_threshold"] == 0.75
    assert cell["median_episodes_to_threshold"] == 35.0
    assert cell["median_seconds_to_threshold"] == 35.0


def test_a_threshold_that_half_the_learners_miss_is_never_reached() -> None:
    (cell,) = summarize_cells(learners("ddpg", [0.9, 0.9, 0.98, 1.0]), 0.97).to_dict("records")
    assert cell["median_episodes_to_threshold"] == math.inf


def test_the_cells_of_an_algorithm_are_summarized_together() -> None:
    rows = [learners("ddpg", [0.5, 0.96], name) for name in ("random_disk", "two_clusters")]
    rows.append(learners("sac", [1.0]))
    ddpg, sac = summarize_algorithms(pd.concat(rows), 0.97).to_dict("records")
    assert (ddpg["algorithm"], ddpg["learners"]) == ("ddpg", 4)
    assert ddpg["iqm"] == ddpg["median"] == pytest.approx(0.73)
    assert ddpg["worst"] == 0.5
    assert ddpg["near_optimal"] == 0.5
    assert ddpg["above_threshold"] == 0.0
    assert sac["iqm"] == sac["low"] == sac["high"] == 1.0


def test_random_layouts_are_the_draws_of_one_cell() -> None:
    rows = [learners("ddpg", [0.1 * n], f"layout-{n}") for n in range(1, 10)]
    assert set(in_cells(pd.concat(rows))["scenario"]) == {LAYOUTS}
    (cell,) = summarize_cells(pd.concat(rows), 0.97).to_dict("records")
    assert cell["learners"] == 9
    assert cell["iqm"] == pytest.approx(0.5)
    assert cell["low"] < 0.5 < cell["high"]


def test_a_profile_is_the_share_of_learners_that_reach_a_fraction() -> None:
    profile = performance_profiles(learners("ddpg", [0.2, 0.4, 0.4, 0.8]), [0.0, 0.4, 0.5, 0.9])
    assert profile["share"].tolist() == [1.0, 0.75, 0.25, 0.0]
    assert profile["low"].tolist() == [1.0, 0.25, 0.0, 0.0]
    assert profile["high"].tolist() == [1.0, 1.0, 0.75, 0.0]


def test_improvements_are_given_both_ways() -> None:
    rows = pd.concat([learners("ddpg", [0.8, 0.9]), learners("sac", [0.1, 0.2])])
    assert improvements(rows).to_numpy().tolist() == [
        ["ddpg", "sac", 1.0, 1.0, 1.0],
        ["sac", "ddpg", 0.0, 0.0, 0.0],
    ]


def test_improvements_are_means_over_the_cells_that_both_have() -> None:
    rows = pd.concat(
        [
            learners("ddpg", [0.8, 0.9], "random_disk"),
            learners("sac", [0.1, 0.2], "random_disk"),
            learners("ddpg", [0.1], "two_clusters"),
            learners("sac", [0.2], "two_clusters"),
            learners("sac", [1.0], "layout-3"),
        ]
    )
    assert improvements(rows)["probability"].tolist() == [0.5, 0.5]


def test_one_algorithm_has_none_to_improve_on() -> None:
    assert improvements(learners("ddpg", [0.5])).empty


def test_learning_curves_are_means_at_each_evaluation() -> None:
    rows = [
        learners("ddpg", [0.0, 1.0 * n], name).assign(episode=10 * n)
        for n in (1, 2)
        for name in ("random_disk", "two_clusters")
    ]
    curve = learning_curves(pd.concat(rows))
    assert curve["episode"].tolist() == [10, 20]
    assert curve["iqm"].tolist() == [0.5, 1.0]
    assert (curve["low"] < curve["iqm"]).all()
    assert (curve["high"] > curve["iqm"]).all()


def test_a_learner_that_stopped_stays_at_its_best_in_learning_curves() -> None:
    first, second = learners("ddpg", [0.2, 0.4]), learners("ddpg", [0.3, 0.8])
    rows = [first.assign(episode=10), second[:1].assign(episode=20)]
    curve = learning_curves(pd.concat(rows))
    assert curve["episode"].tolist() == [10, 20]
    assert curve["iqm"].tolist() == pytest.approx([0.3, 0.35])
    assert learning_curves(pd.concat(rows)[:0]).empty
