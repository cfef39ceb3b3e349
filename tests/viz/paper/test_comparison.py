"""The pictures of a comparison show what was compared, with one algorithm or with many."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from hyuav.experiments.comparison.plan import ENTRIES, PIECES
from hyuav.experiments.comparison.statistics import (
    improvements,
    learning_curves,
    performance_profiles,
    summarize_cells,
)
from hyuav.experiments.comparison.tables import MOST_COLUMNS, label
from hyuav.viz.data.comparison import entry_color, entry_line
from hyuav.viz.paper.comparison import (
    cell_means,
    curves_figure,
    improvement_bars,
    profiles_figure,
)

ABLATION = (*ENTRIES, *(f"ddpg_robust-{piece}" for piece in PIECES))


def learners(algorithms: tuple[str, ...]) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    return pd.DataFrame(
        [
            {
                "algorithm": algorithm,
                "scenario": scenario,
                "scheme": scheme,
                "num_slots": 20,
                "seed": seed,
                "episode": episode,
                "fraction": rng.uniform(0.8, 1.0),
                "episodes_to_threshold": np.nan,
                "seconds_to_threshold": np.nan,
            }
            for algorithm in algorithms
            for scenario in ("random_disk", "two_clusters", "layout-7")
            for scheme in ("hybrid", "relay")
            for seed in range(3)
            for episode in (10, 20)
        ]
    )


def legend(figure: Figure) -> list[str]:
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for own in legends if own is not None for text in own.get_texts()]


@pytest.mark.parametrize("algorithms", [("td3",), ENTRIES], ids=["one", "all"])
def test_every_algorithm_is_named_in_its_color(algorithms: tuple[str, ...]) -> None:
    rows = learners(algorithms)
    last = rows[rows["episode"] == 20]
    names = [label(algorithm) for algorithm in algorithms]
    cells = cell_means(summarize_cells(last, 0.97))
    assert legend(cells) == [*names, "worst learner"]
    shown = [axes.get_title() for axes in cells.axes if axes.get_visible()]
    assert shown == ["random_disk, T = 20", "two_clusters, T = 20", "layouts, T = 20"]
    for figure in (
        curves_figure(learning_curves(rows), 0.97),
        profiles_figure(performance_profiles(last, np.linspace(0.8, 1.0, 5)), 0.97),
    ):
        assert legend(figure) == names
        lines = {str(line.get_label()): line for line in figure.axes[0].lines}
        colors = {name: to_hex(lines[label(name)].get_color()) for name in algorithms}
        assert colors == {name: entry_color(name).lower() for name in algorithms}


def test_no_two_algorithms_have_the_same_color() -> None:
    assert len(set(map(entry_color, ENTRIES))) == len(ENTRIES)


def test_no_two_entries_of_an_ablation_look_alike() -> None:
    looks = {(entry_color(entry), entry_line(entry)) for entry in ABLATION}
    assert len(looks) == len(ABLATION)


@pytest.mark.parametrize("algorithms", [("td3",), ENTRIES, ABLATION], ids=["one", "all", "pieces"])
def test_nothing_leaves_the_picture_nor_covers_the_curves(algorithms: tuple[str, ...]) -> None:
    rows = learners(algorithms)
    last = rows[rows["episode"] == 20]
    for figure in (
        cell_means(summarize_cells(last, 0.97)),
        curves_figure(learning_curves(rows), 0.97),
        profiles_figure(performance_profiles(last, np.linspace(0.8, 1.0, 5)), 0.97),
        *([improvement_bars(improvements(last))] if len(algorithms) > 1 else []),
    ):
        figure.draw_without_rendering()
        drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert drawn.x0 >= 0.0
        assert drawn.y0 >= 0.0
        assert drawn.x1 <= width
        assert drawn.y1 <= height
        visible = [axes for axes in figure.axes if axes.get_visible()]
        assert min(axes.get_window_extent().width for axes in visible) > 1.4 * figure.dpi
        for legend_below in figure.legends:
            box = legend_below.get_window_extent()
            assert not any(box.overlaps(axes.get_window_extent()) for axes in visible)


def test_each_pair_is_shown_once() -> None:
    few = ENTRIES[:MOST_COLUMNS]
    figure = improvement_bars(improvements(learners(few)))
    assert len(figure.axes[0].get_yticks()) == len(few) * (len(few) - 1) / 2


def test_of_many_only_the_first_is_set_beside_the_others() -> None:
    figure = improvement_bars(improvements(learners(ENTRIES)))
    named = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert named == [label(entry) for entry in ENTRIES[1:]]


@pytest.mark.parametrize("entry", ["drifting", "ddpg_robust-noise_floor"])
def test_what_is_not_offered_any_more_is_drawn_in_grey(entry: str) -> None:
    assert entry_color(entry) not in {entry_color(known) for known in ENTRIES}
    assert entry_line(entry) == 0
    assert label(entry)
