import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hyuav import InputError
from hyuav.experiments.regimes.plan import Axis
from hyuav.experiments.regimes.work import SCHEMES
from hyuav.viz.data.regimes import (
    axis_label,
    edges,
    judged,
    read_regimes,
    shade,
    shares_table,
    times,
)
from regime_maps import BEST, write_map


def test_the_simplest_scheme_that_comes_near_the_best_is_named(tmp_path: Path) -> None:
    found = read_regimes(write_map(tmp_path / "map"))
    assert found.rows["best"].tolist() == BEST
    np.testing.assert_allclose(found.rows["factor"], [3.0, 2.01, np.inf, 1.5, np.nan, np.nan])
    gains = [2.0, 40 / 20.1, 1.0, 1.0, np.nan, np.inf]
    np.testing.assert_allclose(found.rows["gain"], gains)
    assert found.shades[0].tolist() == [3, 2, 3]
    assert found.present == ["no_helper", "relay", "jamming", "hybrid", "nothing"]
    shares = shares_table(found).set_index("best")
    assert shares.loc["nothing", "share"] == pytest.approx(2 / 6)
    told = {"no_helper": "3.00", "jamming": "∞", "hybrid": "1.50", "nothing": "-"}
    for name, text in told.items():
        assert times(float(shares["factor"][name])) == text


def test_rows_are_y_and_columns_are_x(tmp_path: Path) -> None:
    found = read_regimes(write_map(tmp_path / "map"))
    assert found.grid("jamming_power")[1] == pytest.approx([1e-3, 1e-2, 1e-1])
    assert found.grid("eavesdropper_distance")[:, 0].tolist() == [40.0, 80.0]
    assert found.grid("best")[1, 0] == "hybrid"


def test_the_hybrid_scheme_counts_as_another_to_no_helper_alone() -> None:
    rows = pd.DataFrame([(10.0, 2.0, 4.0, 5.0, 10.0)], columns=SCHEMES)
    assert judged(rows)["factor"].tolist() == [2.0]
    rows = pd.DataFrame([(1.0, 2.0, 5.0, 5.0, 10.0)], columns=SCHEMES)
    assert judged(rows)["factor"].tolist() == [2.5]


def test_the_scenarios_own_point_is_the_papers_unless_it_was_changed(tmp_path: Path) -> None:
    found = read_regimes(write_map(tmp_path / "paper", num_slots=5))
    assert found.own == pytest.approx((0.08, 80 * 2**0.5))
    assert found.own_label == "the paper's values"
    found = read_regimes(write_map(tmp_path / "own", jamming_power=0.02))
    assert found.own[0] == 0.02
    assert found.own_label == "the scenario's own values"


def test_cells_end_halfway_between_the_values() -> None:
    assert edges(Axis("ue_power", 1.0, 3.0, 2, "linear")).tolist() == [0.0, 2.0, 4.0]
    log = edges(Axis("ue_power", 0.01, 1.0, 2))
    np.testing.assert_allclose(log, [1e-3, 0.1, 10.0])


def test_what_is_swept_is_told_with_its_unit() -> None:
    assert axis_label(Axis("jamming_power")) == "Jamming power (W)"
    assert axis_label(Axis("ground_to_air_k_factor")) == "Ground-to-air K-factor (dB)"
    assert axis_label(Axis("ue_power")) == "UE power (W)"
    far = Axis("eavesdropper_distance", 1.0, 2.0)
    assert axis_label(far) == "Distance of the eavesdropper from L (m)"


def test_the_strongest_shade_is_the_color_itself() -> None:
    assert shade("#0072B2", 3) == "#0072B2"
    assert shade("#0072B2", 0) == "#B2D5E8"


@pytest.mark.parametrize("damage", ["cut", "column", "text", "a pipe", "missing", "infinite"])
def test_a_table_that_is_not_a_maps_is_refused_in_one_line(tmp_path: Path, damage: str) -> None:
    file = write_map(tmp_path / "map") / "regimes.csv"
    lines = file.read_text().splitlines()
    file.unlink()
    if damage == "a pipe":
        os.mkfifo(file)
    elif damage != "missing":
        lines = {
            "cut": lines[:-1],
            "column": [line.rpartition(",")[0] for line in lines],
            "text": [*lines[:-1], lines[-1].replace("3.0", "loud")],
            "infinite": [*lines[:-1], lines[-1].replace("3.0", "inf")],
        }[damage]
        file.write_text("\n".join(lines))
    with pytest.raises(InputError) as refused:
        read_regimes(file.parent)
    assert "the table of a map of regimes with 6 points (`hyuav regimes`" in str(refused.value)
    assert "\n" not in str(refused.value)
