import dataclasses
from pathlib import Path

import pytest

from dashboard_runs import SCENARIO
from hyuav import Scenario
from hyuav._support.errors import InputError
from hyuav.references.optimum import solve_optimum
from hyuav.viz.data.flying import (
    COARSE_DRAWS,
    checkpoint_of,
    flown,
    flown_by,
    optimum,
    resolution,
)
from hyuav.viz.data.index import RunIndex


def test_the_optimum_of_the_page_is_that_of_the_solver() -> None:
    coarse = optimum(SCENARIO, "hybrid", fine=False)
    assert coarse.resolution == 4.0
    expected = solve_optimum(SCENARIO, ["hybrid"], resolution=4.0, draws=COARSE_DRAWS)["hybrid"]
    assert coarse.path.equal(expected.path)


def test_the_coarse_grid_holds_the_longest_step_of_a_slot() -> None:
    for speed in (1.0, 7.0, 20.0, 1000.0):
        scenario = dataclasses.replace(SCENARIO, max_speed=speed)
        spacing = resolution(scenario, fine=False)
        assert speed / spacing == pytest.approx(round(speed / spacing))
        assert resolution(scenario, fine=True) <= spacing <= 4.0


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"num_slots": 501}, "num_slots = 501: expected a whole number <= 500"),
        ({"ue_positions": [(0.0, 0.0)] * 201}, "number of UEs = 201: expected"),
        ({"max_speed": 0.1}, "max_speed = 0.1: expected at least 0.5 m/s"),
    ],
)
def test_what_takes_too_long_to_solve_is_refused(changed: dict[str, object], line: str) -> None:
    with pytest.raises(InputError) as refused:
        resolution(Scenario.from_dict(SCENARIO.to_dict() | changed), fine=False)
    assert str(refused.value).startswith(line)


def test_a_checkpoint_flies_beside_the_optimum_in_a_changed_scenario(trained_runs: Path) -> None:
    checkpoint = checkpoint_of(RunIndex(trained_runs), "tiny", 0)
    louder = dataclasses.replace(SCENARIO, jamming_power=0.01, num_slots=12)
    schemes = flown(louder, "hybrid", checkpoint).summary["schemes"]
    assert set(schemes) == {"optimum", "proposed", "generalist", "no_helper"}
    assert schemes["generalist"]["fraction_of_optimum"] > 0.9
    assert schemes["proposed"]["fraction_of_optimum"] < 1.0
    before = flown(SCENARIO, "hybrid", checkpoint).summary["schemes"]
    assert schemes["optimum"]["secrecy_sum_rate"] != before["optimum"]["secrecy_sum_rate"]


def test_each_learner_of_a_run_flies_its_own_trajectory(trained_runs: Path) -> None:
    index = RunIndex(trained_runs)
    first, second = (
        flown_by(SCENARIO, rule, checkpoint_of(index, "tiny", number)).flights
        for number, rule in enumerate(("hybrid", "relay"))
    )
    assert first["scheme"].unique().tolist() == ["proposed"]
    assert second["relay"].all()
    assert (first["x"] - second["x"]).abs().max() > 0.1


def test_a_checkpoint_flies_only_with_as_many_ues_as_it_knows(trained_runs: Path) -> None:
    checkpoint = checkpoint_of(RunIndex(trained_runs), "tiny", 0)
    fewer = dataclasses.replace(SCENARIO, ue_positions=SCENARIO.ue_positions[1:])
    with pytest.raises(InputError, match="number of UEs = 9: expected 10, for which"):
        flown(fewer, "hybrid", checkpoint)


def test_a_checkpoint_alone_flies_no_longer_than_one_waits(trained_runs: Path) -> None:
    longer = dataclasses.replace(SCENARIO, num_slots=501)
    with pytest.raises(InputError, match="num_slots = 501: expected a whole number <= 500"):
        flown_by(longer, "hybrid", checkpoint_of(RunIndex(trained_runs), "tiny", 0))


def test_a_foreign_checkpoint_is_refused_and_a_mended_one_taken(runs: Path) -> None:
    index, file = RunIndex(runs), runs / "tiny" / "checkpoints" / "best.pt"
    kept = file.read_bytes()
    file.write_bytes(kept[:100])
    with pytest.raises(InputError, match="not a checkpoint, truncated or damaged"):
        flown_by(SCENARIO, "hybrid", checkpoint_of(index, "tiny", 0))
    file.write_bytes(kept)
    assert len(flown_by(SCENARIO, "hybrid", checkpoint_of(index, "tiny", 0)).flights) == 30


def test_a_run_without_a_checkpoint_has_none_to_fly(runs: Path) -> None:
    (runs / "tiny" / "checkpoints" / "best.pt").unlink()
    with pytest.raises(InputError, match=r"run = 'tiny': expected .*checkpoints/best\.pt"):
        checkpoint_of(RunIndex(runs), "tiny", 0)
