"""Flying the generalist as a user calls for it."""

import json
from pathlib import Path

import pytest

import hyuav
from hyuav import InputError, Scenario
from recipe_calls import Call, Refusal

Printed = pytest.CaptureFixture[str]

SMALL = ("episodes=4", "resolution=10", "scenario.num_slots=6")


def test_a_preset_is_flown_beside_all_it_is_compared_with(
    call: Call, tmp_path: Path, capsys: Printed
) -> None:
    call("fly", *SMALL, "hydra.run.dir=here")
    printed = capsys.readouterr().out
    for label in ("Generalist", "Ja-generalist", "Re-generalist", "No helper", "Re-LT", "Optimum"):
        assert f" {label} " in printed
    assert "the optimum is of a grid of 10 m" in printed
    here = tmp_path / "here"
    summary = json.loads((here / "evaluation.json").read_text())
    told = summary["schemes"]["generalist"]
    assert told["fraction_of_optimum"] > 0.9
    assert summary["episodes"] == 4
    assert (here / "figures" / "flight_map.png").is_file()


def test_refined_flights_earn_no_less() -> None:
    scenario = Scenario.preset("random_disk")
    plain, better = (
        hyuav.fly(scenario, episodes=20, refine=refine).summary["schemes"]["generalist"]
        for refine in (False, True)
    )
    earned = plain["secrecy_sum_rate"]["mean"]
    assert better["secrecy_sum_rate"]["mean"] > 0.999 * earned


def test_positions_alone_are_a_scenario(tmp_path: Path) -> None:
    flown = hyuav.fly(hyuav.disk(6, seed=3), episodes=3, resolution=10.0, output=tmp_path)
    assert flown.summary["schemes"].keys() >= {"generalist", "optimum", "no_helper"}
    assert (tmp_path / "evaluation.json").is_file()


def test_a_place_that_cannot_be_written_to_is_refused_before_anything_is_flown(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"^output = .*: expected a writable place"):
        hyuav.fly("two_clusters", output=tmp_path / "file" / "below")


def test_a_mistake_is_answered_by_one_line(refusal: Refusal) -> None:
    assert "episodes = 1: expected" in refusal("fly", "episodes=1")
    assert "resolution = 0" in refusal("fly", "resolution=0")
    with pytest.raises(InputError, match=r"^episodes = 1: expected "):
        hyuav.fly("two_clusters", episodes=1)
