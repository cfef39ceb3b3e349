"""The main job: over several layouts and horizons, and at its full length."""

import dataclasses
import json
import re
from pathlib import Path

import pandas as pd
import pytest

from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import GENERALISTS, LABELS
from hyuav.physics.scenario import PRESETS
from hyuav.viz.paper.gallery import FIGURES
from offline_wandb import history, offline_runs, recorded
from recipe_calls import FEW, TINY, Call, Refusal

ENERGY = ("candidates=2", "candidate_episodes=3", "figures=[learning_curves,energy]")
"""What two tests ask for, so that it is done once."""

JOB = [
    *TINY,
    "candidates=1",
    *FEW,
    "scenario.num_slots=8",
    "hydra.run.dir=job",
]


def test_the_figures_of_several_layouts_and_horizons_come_from_one_command(
    call: Call, tmp_path: Path
) -> None:
    seeds = ("seeds=2", "further_seeds=1")
    call("reproduce", *seeds, "num_slots=[8,10]", "also=random_disk", *JOB)
    job = tmp_path / "job"
    learners = RunDirectory(job).configuration().learners
    assert [own.num_slots for own in learners] == [8] * 6 + [10] * 3
    files = {path.name for path in (job / "figures").iterdir()}
    prints = {f"{name}.{suffix}" for name in FIGURES for suffix in ("pdf", "png", "csv")}
    assert files == prints - {"animation.pdf", "animation.png"} | {
        *("animation.gif", "trajectories_nodes.csv", "flight_map_nodes.csv")
    }
    horizons = pd.read_csv(job / "figures" / "horizons.csv")
    assert horizons.groupby("num_slots")["scheme"].count().to_dict() == {8: 11, 10: 10}
    proposed = horizons[horizons["scheme"] == "proposed"].set_index("num_slots")
    assert proposed["learners"].to_dict() == {8: 2, 10: 1}
    beside = RunDirectory(job / "random_disk")
    configuration = beside.configuration()
    assert configuration.scenario == dataclasses.replace(PRESETS["random_disk"], num_slots=8)
    assert len(configuration.learners) == 3
    assert (beside.figures / "trajectories.pdf").exists()
    paper = RunDirectory(job / "as_in_paper").metrics()
    assert len(paper) == 4 * 6
    assert set(paper["num_slots"]) == {8}


def test_all_of_a_job_is_one_group_and_its_parts_are_named_after_it(
    call: Call, tmp_path: Path
) -> None:
    call(
        "reproduce",
        *JOB,
        *("num_slots=10", "also=random_disk", "figures=learning_curves", "logger.mode=offline"),
        "algorithm=ddpg",
    )
    job = tmp_path / "job"
    parts = ("as_in_paper", "with_power", "random_disk", "horizons/T10")
    places = (job, *(job / name for name in parts))
    files = [file for place in places for file in offline_runs(place)]
    runs = [recorded(file, "run")[0] for file in files]
    assert sorted((run.job_type, run.display_name) for run in runs) == [
        ("evaluate", "job"),
        ("evaluate", "job/horizons/T10"),
        ("evaluate", "job/random_disk"),
        ("train", "job"),
        ("train", "job/as_in_paper"),
        ("train", "job/random_disk"),
        ("train", "job/with_power"),
    ]
    assert {run.run_group for run in runs} == {"job"}
    assert json.loads((job / "as_in_paper" / "wandb.json").read_text())["group"] == "job"
    assert all(
        "schemes/path" in history(file)[-1]
        for file, run in zip(files, runs, strict=True)
        if run.job_type == "evaluate"
    )


def test_the_helpers_power_is_learned_beside_the_papers_schemes(once: Call, tmp_path: Path) -> None:
    once("reproduce", "algorithm=ddpg", *JOB, *ENERGY, "power_episodes=2")
    with_power = RunDirectory(tmp_path / "job" / "with_power")
    configuration = with_power.configuration()
    assert configuration.scenario.power_control
    assert {learner.scheme for learner in configuration.learners} == {"hybrid"}
    assert configuration.training.num_episodes == 2
    schemes = json.loads((tmp_path / "job" / "evaluation.json").read_text())["schemes"]
    assert set(schemes) == {*LABELS} - {*GENERALISTS.values()}
    own, best = (schemes[f"{name}_power"]["secrecy_sum_rate"] for name in ("proposed", "optimum"))
    assert schemes["proposed_power"]["fraction_of_optimum"] == own["mean"] / best["mean"]
    energy = pd.read_csv(tmp_path / "job" / "figures" / "energy.csv")
    assert set(energy.dropna(subset="power_level")["scheme"]) == {"proposed_power"}


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_shows_progress_of_all_that_takes_time_and_a_pipe_gets_none(
    call: Call,
    once: Call,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    terminal: bool,
) -> None:
    if terminal:
        for name, value in (("TTY_COMPATIBLE", "1"), ("TTY_INTERACTIVE", "1"), ("COLUMNS", "100")):
            monkeypatch.setenv(name, value)
    do = call if terminal else once
    do("reproduce", "algorithm=ddpg", *JOB, *ENERGY, "power_episodes=2")
    written = capsys.readouterr().out
    told = re.sub(r"\x1b\[[\d;?]*\w", "", written)
    for task, total in (
        ("initial weights", 3),
        ("training", 4),
        ("optima", 3),
        ("evaluating", 14),
        ("figures", 2),
        ("reports", 1),
    ):
        assert bool(re.search(rf"{task} \S* *{total}/{total} ", told)) == terminal, task
    assert ("0:00:00 left" in told) == ("\x1b" in written) == terminal


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["figures=[horizons]"], "num_slots = None: expected horizons besides the scenario's 8"),
        (["figures=horizons", "num_slots=8"], "num_slots = (8,): expected horizons besides"),
        (["also=two_clusters"], "also[0] = 'two_clusters': expected presets that differ"),
        (["also=[random_disk,random_disk]"], "also[1] = 'random_disk': expected presets that"),
        (["also=../elsewhere"], "also = '../elsewhere': expected one of random_disk, two_clusters"),
        (["figures=[fig4]"], "figures[0] = 'fig4': expected one of learning_curves"),
    ],
)
def test_what_cannot_be_drawn_is_refused_before_any_training(
    refusal: Refusal, tmp_path: Path, arguments: list[str], line: str
) -> None:
    assert line in refusal("reproduce", *arguments, *JOB)
    assert not (tmp_path / "job").exists()


@pytest.mark.slow
def test_the_main_job_finds_what_the_paper_reports(call: Call, tmp_path: Path) -> None:
    """The order of the schemes, the distance to the optimum, and relaying before jamming."""
    call("reproduce", "hydra.run.dir=job", "logger.mode=disabled")
    schemes = json.loads((tmp_path / "job" / "evaluation.json").read_text())["schemes"]
    rate = {name: result["secrecy_sum_rate"]["mean"] for name, result in schemes.items()}
    order = ["proposed", "ja_ot", "re_ot", "re_lt", "ja_lt"]
    assert sorted(order, key=lambda name: rate[name], reverse=True) == order
    assert schemes["proposed"]["fraction_of_optimum"] >= 0.97
    for name, result in schemes.items():
        half_width = result["secrecy_sum_rate"]["ci95"][1] - rate[name]
        assert rate[name] <= rate["optimum"] + half_width

    flights = pd.read_parquet(tmp_path / "job" / "flights.parquet")
    flown = flights[(flights["scheme"] == "proposed") & (flights["secrecy_sum_rate"] > 0)]
    for _, flight in flown.groupby("episode"):
        relays = flight["relay"].tolist()
        assert relays[0]
        assert relays == sorted(relays, reverse=True)
