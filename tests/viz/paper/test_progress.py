import numpy as np
import pandas as pd

from hyuav.viz.paper.progress import progress_figure


def test_each_training_is_a_line_in_each_panel() -> None:
    steps = pd.Series([100, 200])
    one = pd.DataFrame(
        {"step": steps, "mean": [0.5, 0.9], "fifth_percentile": [0.1, 0.7], "worst": [0.0, 0.5]}
    )
    figure = progress_figure({"imitation": one, "both": one.assign(mean=0.95)})
    panels = figure.axes
    assert [axes.get_title() for axes in panels] == ["mean", "5th percentile", "worst"]
    assert [len(axes.lines) for axes in panels] == [2, 2, 2]
    assert [line.get_label() for line in panels[0].lines] == ["imitation", "both"]
    assert np.asarray(panels[0].lines[1].get_ydata()).tolist() == [0.95, 0.95]
    assert np.asarray(panels[2].lines[0].get_ydata()).tolist() == [0.0, 0.5]
