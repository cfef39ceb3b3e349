from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from hyuav.viz.paper.style import COLUMN_WIDTH, save_figure


def test_a_figure_is_saved_for_print_at_the_width_of_a_column(tmp_path: Path) -> None:
    figure = Figure(figsize=(COLUMN_WIDTH, 1.0))
    figure.add_subplot().set_title("title")
    save_figure(figure, tmp_path / "new", "curves")
    assert imread(tmp_path / "new" / "curves.png").shape[1] == pytest.approx(3.5 * 300, abs=1)
    pdf = (tmp_path / "new" / "curves.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/Subtype /Type3" not in pdf
    assert b"/CIDFontType2" in pdf  # within Type 42


def test_what_a_figure_shows_lies_beside_it(tmp_path: Path) -> None:
    tables = {"": pd.DataFrame({"x": [1.5]}), "nodes": pd.DataFrame({"node": ["L", "E"]})}
    save_figure(Figure(), tmp_path, "map", tables)
    assert (tmp_path / "map.csv").read_text() == "x\n1.5\n"
    assert pd.read_csv(tmp_path / "map_nodes.csv")["node"].tolist() == ["L", "E"]
