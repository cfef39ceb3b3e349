import time

import numpy as np
import pandas as pd
import pytest

from hyuav.experiments.comparison.statistics import summarize_cells
from hyuav.viz.data.curves import learning_curves, learning_table
from hyuav.viz.data.schemes import COLORS, scheme_line
from hyuav.viz.html.comparison_figures import comparison_figures
from hyuav.viz.html.curves import MAX_POINTS, learning_figure


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


def test_what_jams_is_dashed_and_what_the_papers_algorithm_learns_thinner_and_paler() -> None:
    schemes = ["hybrid", "relay", "jamming", "proposed_paper", "re_ot_paper", "ja_ot_paper"]
    figure = learning_figure(_metrics(30, dict.fromkeys(schemes, 1)), {"jamming": 57.0})
    drawn = {trace.name: trace for trace in figure.data if trace.name}
    for name in ("Proposed", "Re-OT", "Ja-OT"):
        own, paper = drawn[name], drawn[f"Paper {name}"]
        assert own.line.dash == paper.line.dash
        assert (own.line.dash == "solid") == (
            scheme_line(name.lower().replace("-", "_")) == "solid"
        )
        assert paper.line.width < own.line.width
        assert paper.opacity < (own.opacity or 1.0)
    assert drawn["its optimum"].line.dash == figure.layout.shapes[0].line.dash
    assert drawn["its optimum"].line.dash not in {drawn["Ja-OT"].line.dash, "solid"}


def test_the_line_and_its_band_are_those_of_the_printed_figure() -> None:
    metrics = _metrics(40, {"hybrid": 8})
    rewards = metrics.pivot_table("accumulated_reward", "episode", "learner")
    rewards[7] += 1000.0
    metrics = rewards.reset_index().melt("episode", value_name="accumulated_reward")
    metrics = metrics.assign(scheme="hybrid", num_slots=20)
    figure = learning_figure(metrics)
    (band,) = (trace for trace in figure.data if trace.fill == "toself")
    (line,) = (trace for trace in figure.data if trace.name == "Proposed")
    printed = learning_table(learning_curves(metrics), {})
    np.testing.assert_allclose(line.y, printed["iqm"], atol=1e-3)
    np.testing.assert_allclose(band.y[:40], printed["low"], atol=1e-3)
    np.testing.assert_allclose(band.y[40:][::-1], printed["high"], atol=1e-3)


def test_a_learner_that_stopped_leaves_the_band_of_the_others() -> None:
    metrics = _metrics(60, {"hybrid": 3})
    early = metrics[(metrics["learner"] != 2) | (metrics["episode"] <= 20)]
    (band,) = (trace for trace in learning_figure(early).data if trace.fill == "toself")
    (line,) = (trace for trace in learning_figure(early).data if trace.name == "Proposed")
    assert len(band.y) == 2 * len(line.y) == 120
    assert np.isfinite(np.array([*band.y, *line.y], dtype=float)).all()


def test_a_hundred_thousand_episodes_of_ten_learners_are_drawn_within_seconds() -> None:
    rewards = np.random.default_rng(0).normal(size=(100_000, 10))
    table = pd.DataFrame(rewards).rename_axis(index="episode", columns="learner")
    rows = table.reset_index().melt("episode", value_name="accumulated_reward")
    began = time.process_time()
    learning_figure(rows.assign(scheme="hybrid", num_slots=20))
    assert time.process_time() - began < 15.0


def test_each_scheme_that_learned_has_the_line_of_its_optimum() -> None:
    metrics = _metrics(5, {"hybrid": 1, "relay": 1})
    figure = learning_figure(metrics, {"hybrid": 60.0, "relay": 43.0, "jamming": 57.0})
    drawn = {shape.y0: shape.line.color for shape in figure.layout.shapes}
    assert drawn == {60.0: COLORS["proposed"], 43.0: COLORS["re_ot"]}


def test_several_horizons_can_be_told_apart() -> None:
    metrics = pd.concat([_metrics(5, {"hybrid": 1}, slots) for slots in (10, 20)])
    lines = {trace.name: trace.line for trace in learning_figure(metrics).data if trace.name}
    assert set(lines) == {"Proposed, T = 10", "Proposed, T = 20"}
    assert {line.dash for line in lines.values()} == {"solid"}
    symbols = {trace.marker.symbol for trace in learning_figure(metrics).data if trace.name}
    assert len(symbols) == 2


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
    several = [figure for *_, figure in comparison_figures(results, curves, cells, 0.97)]
    for figure in several:
        assert {"DDPG", "SAC"} <= {trace.name for trace in figure.data}
    shown = [x for trace in several[0].data if trace.name in ("DDPG", "SAC") for x in trace.x]
    np.testing.assert_allclose(shown, 100 * cells["iqm"])
