"""Flying a family of scenarios as a user calls for it."""

from pathlib import Path

import pandas as pd
import pytest

from recipe_calls import Call, Refusal

TINY = (
    *("families", "output=here", "workers=1", "scenarios=2", "episodes=2"),
    *("resolution=10", "drawn=1"),
)


def test_scenarios_are_flown_told_and_drawn(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call(*TINY)
    printed, here = capsys.readouterr().out, tmp_path / "here"
    table = pd.read_csv(here / "families.csv")
    assert table["seed"].tolist() == [0, 1]
    assert (table["generalist"] <= 1.3 * table["optimum"]).all()  # whose grid is coarse here
    assert "worst seeds: " in printed
    assert (here / "families.png").is_file()
    assert len([*(here / "worst").glob("*.png")]) == 1


def test_another_evaluation_is_refused(call: Call, refusal: Refusal) -> None:
    call(*TINY)
    line = refusal(*TINY, "family=two")
    assert "expected an evaluation of a family with family = two (there it is one)" in line
    assert "family = 'three'" in refusal(*TINY, "family=three")
