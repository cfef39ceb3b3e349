import numpy as np
import pandas as pd
import pytest

from hyuav.comparison.statistics import summarize_cells
from hyuav.figures import COLORS
from hyuav.report.curves import MAX_POINTS, comparison_figures, learning_figure


def _metrics(episodes: int, schemes: dict[str, int], num_slots: int = 20) -> pd.DataFrame:
    """Rows as training logs them: learners of each scheme that earn ever more."""
    rng = np.random.default_rng(0)
    tables, learner = [], 0
    for scheme, learners in schemes.items():
        for _ in range(learners):
            episode = np.arange(1, episodes + 1)
            reward = 50 * episode / episodes + rng.normal(size=episodes)
            identity = {"learner": learner, "scheme": scheme, "seed": learner}
            columns = {"episode": episode, "accumulated_reward": reward, "num_slots": num_slots}
            tables.append(pd.DataFrame(identity | columns))
            learner += 1
    return pd.concat(tables, ignore_index=True)


def test_a_hundred_thousand_episodes_are_drawn_by_few_points_that_tell_the_same() -> None:
    metrics = _metrics(100_000, {"hybrid": 1})
    figure = learning_figure(metrics)
    (mean,) = (trace for trace in figure.data if trace.name == "Proposed")
    assert max(len(trace.x) for trace in figure.data) <= MAX_POINTS
    assert mean.x[-1] == 100_000
    np.testing.assert_allclose(mean.y, 50 * np.array(mean.x) / 100_000, atol=0.5)


def test_a_scheme_has_its_color_in_every_figure() -> None:
    metrics = _metrics(30, {"hybrid": 2, "relay": 1, "jamming": 1, "proposed_paper": 1})
    lines = {trace.name: trace.line for trace in learning_figure(metrics).data if trace.name}
    assert {name: line.color for name, line in lines.items()} == {
        "Proposed": COLORS["proposed"],
        "Re-OT": COLORS["re_ot"],
        "Ja-OT": COLORS["ja_ot"],
        "Paper Proposed": COLORS["proposed"],
    }
    assert lines["Proposed"].dash == "solid"
    assert lines["Paper Proposed"].dash != "solid"


def test_the_band_goes_from_the_worst_to_the_best_learner() -> None:
    metrics = _metrics(40, {"hybrid": 3})
    (band,) = (trace for trace in learning_figure(metrics).data if trace.fill == "toself")
    smooth = (
        metrics.pivot_table("accumulated_reward", "episode", "learner")
        .rolling(25, min_periods=1)
        .mean()
    )
    np.testing.assert_allclose(band.y[:40], smooth.min(axis=1), atol=1e-3)
    np.testing.assert_allclose(band.y[40:][::-1], smooth.max(axis=1), atol=1e-3)


def test_each_scheme_that_learned_has_the_line_of_its_optimum() -> None:
    metrics = _metrics(5, {"hybrid": 1, "relay": 1})
    figure = learning_figure(metrics, {"hybrid": 60.0, "relay": 43.0, "jamming": 57.0})
    drawn = {shape.y0: shape.line.color for shape in figure.layout.shapes}
    assert drawn == {60.0: COLORS["proposed"], 43.0: COLORS["re_ot"]}


def test_several_horizons_can_be_told_apart() -> None:
    metrics = pd.concat([_metrics(5, {"hybrid": 1}, slots) for slots in (10, 20)])
    lines = {trace.name: trace.line for trace in learning_figure(metrics).data if trace.name}
    assert set(lines) == {"Proposed, T = 10", "Proposed, T = 20"}
    assert len({line.dash for line in lines.values()}) == 2


def test_metrics_without_rows_say_so() -> None:
    figure = learning_figure(_metrics(1, {"hybrid": 1}).iloc[:0], {"hybrid": 1.0})
    assert [note.text for note in figure.layout.annotations] == ["no episodes yet"]


def test_names_from_files_bring_no_tags_into_a_figure() -> None:
    metrics = _metrics(3, {"<b>bold</b>": 1})
    (name,) = (trace.name for trace in learning_figure(metrics).data if trace.name)
    assert name == "&lt;b&gt;bold&lt;/b&gt;"


@pytest.fixture
def results() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    return pd.DataFrame(
        [
            {
                "algorithm": algorithm,
                "scenario": "two_clusters",
                "scheme": scheme,
                "num_slots": 20,
                "seed": seed,
                "fraction": 0.9 + 0.1 * rng.random(),
                "episodes_to_threshold": 100.0,
                "seconds_to_threshold": 3.0,
                "seconds": 5.0,
            }
            for algorithm in ("ddpg", "sac")
            for scheme in ("hybrid", "relay")
            for seed in range(3)
        ]
    )


def test_a_comparison_shows_every_cell_and_every_algorithm(results: pd.DataFrame) -> None:
    cells = summarize_cells(results, 0.97)
    curves = pd.concat([results.assign(episode=episode) for episode in (5, 10)])
    several = list(comparison_figures(results, curves, cells, 0.97).values())
    for figure in several:
        assert {"DDPG", "SAC"} <= {trace.name for trace in figure.data}
    shown = [x for trace in several[0].data if trace.name in ("DDPG", "SAC") for x in trace.x]
    np.testing.assert_allclose(shown, 100 * cells["iqm"])
