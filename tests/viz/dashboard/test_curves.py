import numpy as np
import pandas as pd
import pytest
from scipy import stats

from hyuav.viz.dashboard.curves import MOST_POINTS, Choice, comparison
from hyuav.viz.data.schemes import COLORS, scheme_line
from hyuav.viz.html.style import DASHES


def metrics(rewards: np.ndarray, scheme: str = "hybrid", num_slots: int = 10) -> pd.DataFrame:
    """Rows of learners (episodes, learners) of one scheme."""
    episodes, learners = rewards.shape
    return pd.DataFrame(
        {
            "episode": np.repeat(np.arange(1.0, episodes + 1), learners),
            "slots": num_slots * np.repeat(np.arange(1.0, episodes + 1), learners),
            "learner": np.tile(np.arange(float(learners)), episodes),
            "scheme": scheme,
            "num_slots": float(num_slots),
            "accumulated_reward": rewards.ravel(),
            "loss_critic": 1.0,
        }
    )


def ramp(episodes: int, learners: int) -> np.ndarray:
    return np.arange(1.0, episodes + 1)[:, None] * np.arange(1.0, learners + 1)


PLAIN = Choice(smoothing=1)


def test_a_schemes_learners_are_thin_lines_of_its_color_beside_their_mean() -> None:
    figure = comparison({"run": metrics(ramp(5, 3), "relay")}, {}, PLAIN)
    thin, mean = figure.data
    assert thin.line.color == mean.line.color == COLORS["re_ot"]
    assert thin.line.width < mean.line.width
    assert mean.name == "Re-OT (mean of 3)"
    assert list(mean.y) == pytest.approx([2.0, 4.0, 6.0, 8.0, 10.0])
    assert np.isnan(np.asarray(thin.y, dtype=float)).sum() == 3  # a gap behind each learner


def test_the_mean_of_many_learners_is_interquartile() -> None:
    rewards = ramp(4, 8)
    rewards[:, -1] = 1e6
    mean = comparison({"run": metrics(rewards)}, {}, PLAIN).data[-1]
    assert mean.name == "Proposed (interquartile mean of 8)"
    assert list(mean.y) == pytest.approx(stats.trim_mean(rewards, 0.25, axis=1))


def test_runs_differ_in_their_dashes_and_if_so_chosen_in_their_colors() -> None:
    both = {"one": metrics(ramp(3, 1)), "two": metrics(ramp(3, 1))}
    by_scheme = comparison(both, {}, PLAIN).data
    assert [line.line.color for line in by_scheme] == [COLORS["proposed"]] * 2
    assert by_scheme[0].line.dash != by_scheme[1].line.dash
    by_run = comparison(both, {}, Choice(smoothing=1, color_by="run")).data
    assert by_run[0].line.color != by_run[1].line.color
    assert [line.name for line in by_run] == ["Proposed, one", "Proposed, two"]


def test_a_learner_that_stops_takes_part_in_the_mean_until_then() -> None:
    rewards = ramp(4, 8)
    rewards[:, -1] = 1e6
    rewards[2:, 0] = np.nan
    mean = comparison({"run": metrics(rewards)}, {}, PLAIN).data[-1]
    expected = [
        *stats.trim_mean(rewards[:2], 0.25, axis=1),
        *stats.trim_mean(rewards[2:, 1:], 0.25, axis=1),
    ]
    assert list(mean.y) == pytest.approx(expected)


def test_a_single_runs_schemes_have_the_lines_of_every_figure() -> None:
    rules = ("hybrid", "relay", "jamming")
    rows = pd.concat([metrics(ramp(3, 1), rule) for rule in rules])
    dashes = [line.line.dash for line in comparison({"run": rows}, {}, PLAIN).data]
    assert dashes == [DASHES[scheme_line(scheme)] for scheme in ("proposed", "re_ot", "ja_ot")]
    both = comparison({"one": rows, "two": rows}, {}, Choice(smoothing=1, color_by="run")).data
    assert len({line.line.dash for line in both[:3]}) == 3
    assert "dot" not in {line.line.dash for line in both}  # as only optima are


def test_curves_are_smoothed_over_episodes_and_drawn_against_slots() -> None:
    rewards = np.array([[0.0], [2.0], [4.0], [6.0]])
    (line,) = comparison({"run": metrics(rewards)}, {}, Choice(x="slots", smoothing=2)).data
    assert list(line.x) == [10.0, 20.0, 30.0, 40.0]
    assert list(line.y) == [0.0, 1.0, 3.0, 5.0]


def test_the_optimum_bounds_returns_and_not_losses() -> None:
    run = {"run": metrics(ramp(3, 1))}
    bounded = comparison(run, {"run": {"hybrid": 59.0}}, PLAIN)
    assert [(shape.y0, shape.name) for shape in bounded.layout.shapes] == [(59.0, "Optimum")]
    losses = comparison(run, {"run": {"hybrid": 59.0}}, Choice(y="loss_critic"))
    assert not losses.layout.shapes
    assert losses.layout.yaxis.title.text == "Loss of the critic"


def test_a_hundred_thousand_points_leave_their_extremes_in_the_figure() -> None:
    rewards = np.random.default_rng(0).normal(size=(100_000, 1))
    rewards[54_321] = 99.0
    (line,) = comparison({"run": metrics(rewards)}, {}, PLAIN).data
    assert len(line.x) <= MOST_POINTS
    assert max(line.y) == 99.0
    assert (line.x[0], line.x[-1]) == (1.0, 100_000.0)


def test_a_runs_name_stays_text() -> None:
    both = {"<b>one</b>": metrics(ramp(3, 2)), "two": metrics(ramp(3, 2))}
    names = [line.name for line in comparison(both, {}, PLAIN).data if line.name]
    assert names[0] == "Proposed, &lt;b&gt;one&lt;/b&gt; (mean of 2)"


def test_a_run_without_rows_has_no_lines() -> None:
    assert not comparison({"run": pd.DataFrame()}, {}, PLAIN).data
