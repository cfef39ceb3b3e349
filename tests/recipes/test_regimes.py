"""The map of regimes as a user calls for it, at a size that is small enough for a test."""

import dataclasses
from pathlib import Path

import pandas as pd
import pytest

from hyuav import Scenario
from hyuav.experiments.regimes.plan import Regimes
from hyuav.experiments.regimes.work import SCHEMES, solve_point
from recipe_calls import Call, Refusal

Printed = pytest.CaptureFixture[str]

TINY = (
    *("regimes", "output=here", "workers=1", "resolution=20", "power_step=20"),
    *("scenario.num_slots=4", "scenario.fading=false", "x.points=3", "y.points=2"),
)


def test_a_map_is_solved_printed_kept_and_drawn(
    call: Call, tmp_path: Path, capsys: Printed
) -> None:
    call(*TINY)
    here, printed = tmp_path / "here", capsys.readouterr().out
    rows = pd.read_csv(here / "regimes.csv")
    assert rows.columns.tolist() == ["jamming_power", "eavesdropper_distance", *SCHEMES]
    assert rows["eavesdropper_distance"].tolist() == [0.0] * 3 + [140.0] * 3
    row = rows.iloc[4]
    far = 140.0 / 2**0.5
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"),
        num_slots=4,
        fading=False,
        jamming_power=row["jamming_power"],
        eavesdropper_positions=((far, far),),
    )
    solved = solve_point(scenario, Regimes(resolution=20.0, power_step=20.0))
    assert row[list(SCHEMES)].to_dict() == pytest.approx(solved)
    assert {path.name for path in here.iterdir()} == {
        *("config.yaml", "lines", "report.html"),
        *(f"regimes.{kind}" for kind in ("csv", "png", "pdf")),
    }
    assert "two_clusters, 6 points" in printed
    assert printed.endswith(f"its report: report.html\nmap: {here}\n")
    report = (here / "report.html").read_text(encoding="utf-8")
    assert "What power control adds" in report


def test_only_what_is_missing_is_solved_again_and_another_map_is_refused(
    call: Call, refusal: Refusal, tmp_path: Path, capsys: Printed
) -> None:
    call(*TINY)
    here = tmp_path / "here"
    table = (here / "regimes.csv").read_bytes()
    (here / "regimes.csv").unlink()
    first, second = sorted((here / "lines").iterdir())
    written = first.stat().st_mtime_ns
    second.write_bytes(b"PAR1")
    capsys.readouterr()
    call(*TINY, "retries=0")
    told = capsys.readouterr().err
    assert told == f"{second}: damaged or incomplete, and made anew\n"
    assert (here / "regimes.csv").read_bytes() == table
    assert first.stat().st_mtime_ns == written
    line = refusal(*TINY, "seed=3")
    assert line.endswith(f"{str(here)!r}: expected a map with seed = 3 (there it is 0)\n")


MISTAKES = {
    "x.field=jaming_power": "x.field = 'jaming_power': expected one of num_slots, ",
    "x.field=noise_power": "x.field = 'noise_power': expected x.low=NUMBER and x.high=NUMBER",
    "y.field=jamming_power": "y.field = 'jamming_power': expected another field than x.field",
    "x.low=0": "x.low = 0.0: expected a number > 0, or scale=linear",
    "x.high=1e-7": "x.high = 1e-07: expected a number > low = 1e-06",
    "y.high=200": "y.high = 200.0: expected a value that the scenario takes (eavesdropper_pos",
    "resolution=1e-9": "resolution = 1e-09: expected a number of metres >= ",
    "x.lowest=1": "x: unknown field 'lowest': ",
}


def test_a_mistake_is_answered_by_one_line(refusal: Refusal, tmp_path: Path) -> None:
    for argument, line in MISTAKES.items():
        ranged = ("y.low=1", "y.high=2") if argument.startswith("y.field") else ()
        assert line in refusal(*TINY, argument, *ranged)
        assert not (tmp_path / "here").exists()
