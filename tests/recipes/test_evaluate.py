"""Evaluating trained policies elsewhere, from the command line."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from hyuav import Scenario
from hyuav.references import bounds
from recipe_calls import FEW, TINY, Call, Refusal

SHORT = (*TINY, "training.compile=never")


def summary(directory: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((directory / "evaluation.json").read_text())
    return content


@pytest.fixture
def trained(once: Call, tmp_path: Path) -> Path:
    """A learner for T = 8, of a scenario with T = 20."""
    once("train", "num_slots=8", "hydra.run.dir=run", *SHORT)
    return tmp_path / "run"


def test_learners_fly_by_default_as_long_as_they_were_trained(
    call: Call, once: Call, trained: Path
) -> None:
    once("evaluate", "run=run", *FEW)
    assert summary(trained)["num_slots"] == 8
    call("draw", "run=run", "figures=[trajectories,learning_curves]")
    assert (trained / "figures" / "learning_curves.pdf").exists()


def test_a_policy_flies_elsewhere_beside_the_optimum_there_and_loses_nothing_of_its_own(
    call: Call, once: Call, trained: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    once("evaluate", "run=run", *FEW)
    before = (trained / "evaluation.json").read_bytes()
    call("evaluate", "run=run", "scenario=random_disk", "scenario.num_slots=9", *FEW)
    place = trained / "elsewhere" / "random_disk_T9_trained_for_T8"
    assert f"evaluation: run/elsewhere/{place.name}\n" in capsys.readouterr().out
    assert (place / "report.html").exists()
    found = summary(place)
    assert (found["scenario"], found["num_slots"]) == ("random_disk", 9)
    preset = Scenario.preset("random_disk").to_dict()
    assert found["parameters"] == {**preset, "num_slots": 9}
    assert {"proposed", "optimum"} <= set(found["schemes"])
    call("evaluate", "run=run", "scenario.jamming_power=0.2", "output=loud", *FEW)
    parameters = summary(trained.parent / "loud")["parameters"]
    assert parameters["jamming_power"] == 0.2
    assert parameters["ue_positions"] == Scenario.preset("two_clusters").to_dict()["ue_positions"]
    assert (trained / "evaluation.json").read_bytes() == before


def test_several_helpers_are_trained_evaluated_and_drawn(
    call: Call,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bounds, "FIRST_CELLS", 6**4)  # which makes them coarse
    monkeypatch.setattr(bounds, "ROUNDS", 0)
    crowded = Scenario.preset("two_eavesdroppers")
    crowded = dataclasses.replace(crowded, eavesdroppers="colluding", speed_limit="disc")
    crowded.save(tmp_path / "crowded.yaml")
    call("train", "scenario=crowded.yaml", "scenario.num_slots=5", "hydra.run.dir=run", *SHORT)
    call("evaluate", "run=run", "evaluation.episodes=4", "evaluation.resolution=20")
    told = capsys.readouterr().out
    assert "no flight exceeds " in told
    found = summary(tmp_path / "run")["schemes"]
    best = found["optimum"]
    assert best["secrecy_sum_rate"]["mean"] <= 1.02 * best["upper_bound"]  # the same but for draws
    assert {"fraction_of_upper_bound", "relay_share_1", "off_map_2"} <= set(found["proposed"])
    call("draw", "run=run", "figures=trajectories")
    assert (tmp_path / "run" / "figures" / "trajectories.pdf").exists()
    report = (tmp_path / "run" / "report.html").read_text()
    assert "of own upper bound" in report
    assert "H 2 " in report


REFUSALS = {
    "num_slots=20": "num_slots = 20: expected what learners were trained for, 8\n",
    "scenario.ue_positions=[[0,1]]": "number of UEs = 1: expected 10, for which the checkpoint was",
    "scenario=square": "scenario = 'square': expected one of as_trained, clusters, contested, ",
    "scenario.jamming_power=-1": "jamming_power = -1: expected a number in [0, 1e+06]",
    "scenario.num_slots=0": "num_slots = 0: expected a whole number >= 1",
}


def test_where_a_policy_cannot_fly_is_told_in_one_line(refusal: Refusal, trained: Path) -> None:
    before = sorted(trained.rglob("*"))
    for argument, line in REFUSALS.items():
        assert refusal("evaluate", "run=run", argument).startswith(f"error: {line}")
    assert sorted(trained.rglob("*")) == before


def test_a_sweep_is_evaluated_as_the_list_of_its_runs(
    call: Call, refusal: Refusal, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call("train", "-m", "algorithm=ddpg,td3", "num_slots=8", "hydra.sweep.dir=sweep", *SHORT)
    call("train", "num_slots=6", "hydra.run.dir=sweep/2_short", *SHORT)
    capsys.readouterr()
    call("evaluate", "run=sweep", *FEW)
    assert summary(tmp_path / "sweep" / "evaluation")["schemes"]["proposed"]["learners"] == 2
    told = capsys.readouterr().out.splitlines()
    assert "without learners for T = 8: sweep/2_short" in told
    assert "learners of ddpg, td3 count together" in told
    line = refusal("evaluate", "run=[sweep,sweep/2_short]")
    assert line.startswith("error: run = ['sweep', 'sweep/2_short']: expected different run")
