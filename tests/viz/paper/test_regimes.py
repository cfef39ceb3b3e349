from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgba

from hyuav.viz.data.regimes import REGIME_COLORS, read_regimes
from hyuav.viz.paper.regimes import regimes_figure
from regime_maps import write_map


def test_the_best_scheme_and_the_gain_are_drawn_with_the_papers_point(tmp_path: Path) -> None:
    found = read_regimes(write_map(tmp_path / "map"))
    figure = regimes_figure(found)
    best, gain, bar = figure.axes
    colors = np.asarray(best.collections[0].get_array()).reshape(2, 3, 4)
    np.testing.assert_allclose(colors[0, 2], to_rgba(REGIME_COLORS["jamming"]))  # infinitely
    assert colors[1, 1:, 3].tolist() == [0.0, 0.0]  # the hatching shows that nothing is secret
    shown: Any = np.ma.asarray(gain.collections[0].get_array()).reshape(2, 3)
    assert np.ma.getmaskarray(shown).tolist() == [[False] * 3, [False, True, False]]
    assert shown[0, 0] == 2.0
    for panel in (best, gain):
        (star,) = panel.lines
        assert np.ravel(star.get_xydata()).tolist() == list(found.own)
        assert panel.get_xscale() == "log"
        assert panel.get_yscale() == "linear"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        *("No helper", "Relaying", "Jamming", "Hybrid", "Nothing is secret"),
        "the paper's values",
    ]
    assert bar.get_ylabel() == "Times the best at fixed power"


def test_a_map_without_any_secrecy_is_drawn_too(tmp_path: Path) -> None:
    found = read_regimes(write_map(tmp_path / "map"))
    rows = found.rows.assign(best="nothing", factor=np.nan, gain=np.nan)
    figure = regimes_figure(found._replace(rows=rows))
    figure.canvas.draw()
    assert np.ma.getmaskarray(np.ma.asarray(figure.axes[1].collections[0].get_array())).all()
