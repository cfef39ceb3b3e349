from pathlib import Path

import numpy as np
import pytest

from hyuav.viz.data.regimes import REGIMES, read_regimes
from hyuav.viz.html.document import render
from hyuav.viz.html.page import write_report
from hyuav.viz.html.regimes import BEST, GAIN, VIEWS, regimes_map, regimes_page
from regime_maps import VALUES, write_map


@pytest.mark.parametrize("view", VIEWS)
def test_each_point_tells_what_every_scheme_brings(tmp_path: Path, view: str) -> None:
    found = read_regimes(write_map(tmp_path / "map"))
    (cells,) = regimes_map(found, view).select_traces({"type": "heatmap"})
    told = np.asarray(cells.customdata).reshape(6, -1)
    assert told[:, 2:7].tolist() == [list(values) for values in VALUES]
    assert told[3, -1] == "Hybrid"
    for words in ("Jamming power (W): ", "Hybrid with power control: ", "No helper: "):
        assert words in cells.hovertemplate
    (star,) = regimes_map(found, view).select_traces({"marker.symbol": "star"})
    assert (star.x[0], star.y[0]) == found.own


def test_colors_are_those_of_the_regimes_and_a_gap_is_where_nothing_is_secret(
    tmp_path: Path,
) -> None:
    found = read_regimes(write_map(tmp_path / "map"))
    (cells,) = regimes_map(found, BEST).select_traces({"type": "heatmap"})
    of_regime = np.asarray(cells.z) // 4
    assert [REGIMES[int(place)] for place in of_regime.ravel()] == found.rows["best"].tolist()
    (gains,) = regimes_map(found, GAIN).select_traces({"type": "heatmap"})
    assert np.isnan(np.asarray(gains.z)).tolist() == [[False] * 3, [False, True, False]]
    assert np.exp(gains.z[0][0]) == pytest.approx(2.0)
    assert gains.z[1][2] == gains.zmax  # infinitely many times


def test_the_report_shows_both_views_and_the_shares_of_the_map(tmp_path: Path) -> None:
    page = regimes_page(write_map(tmp_path / "map"))
    assert page.facts == {"Scenario": "two_clusters", "Points": "3 x 2"}
    shown, configuration = page.sections
    assert [picture.title for picture in shown.pictures] == list(VIEWS.values())
    for words in ("No helper", "16.7", "33.3", "3.00", "Nothing is secret", "∞"):
        assert words in shown.tables[0]
    assert "jamming_power" in configuration.tables[0]
    text = write_report(tmp_path / "map").read_text(encoding="utf-8")
    assert "Map of regimes" in text
    assert "What power control adds" in text


def test_a_report_of_an_unfinished_or_damaged_map_says_so(tmp_path: Path) -> None:
    directory = write_map(tmp_path / "map", name="<b>bold</b>")
    assert "<b>bold" not in render(regimes_page(directory))
    (directory / "lines").mkdir()
    (directory / "regimes.csv").write_text("x\n<i>1</i>\n")
    damaged = write_report(directory).read_text(encoding="utf-8")
    assert "expected the table of a map of regimes with 6 points" in damaged
    (directory / "regimes.csv").unlink()
    unfinished = write_report(directory).read_text(encoding="utf-8")
    assert "The map is not finished yet." in unfinished
