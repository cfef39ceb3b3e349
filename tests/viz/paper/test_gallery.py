"""What is drawn from a run directory, by what is in it."""

import dataclasses
import io
import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from hyuav import InputError, Scenario
from hyuav.experiments.elsewhere import horizon_directory
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import train
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.viz.data.runs import AS_IN_PAPER
from hyuav.viz.paper.gallery import FIGURES, draw

OFF = LoggerParameters(mode="disabled")
NEED_NO_EVALUATION = {"learning_curves", "sum_rate_maps"}


def console() -> Console:
    return Console(file=io.StringIO(), width=200)


def said(by: Console) -> str:
    assert isinstance(by.file, io.StringIO)
    return by.file.getvalue()


def drawn(run: RunDirectory) -> set[str]:
    """The figures that are there in print or in motion, with what they show."""
    stems = {path.stem for path in run.figures.iterdir() if path.suffix in (".pdf", ".gif")}
    assert {path.stem for path in run.figures.glob("*.csv")} >= stems
    return stems


@pytest.fixture(scope="module")
def configuration(scenario: Scenario) -> RunConfiguration:
    return RunConfiguration(
        "two_clusters",
        scenario,
        (Learner("hybrid", 0), Learner("hybrid", 1), Learner("relay", 0), Learner("relay", 0, 4)),
        "ddpg",
        DDPG(hidden_sizes=(8,)),
        TrainingParameters(num_episodes=3, batch_size=8, evaluation_episodes=2),
    )


@pytest.fixture(scope="module")
def trained(
    configuration: RunConfiguration, tmp_path_factory: pytest.TempPathFactory
) -> RunDirectory:
    return train(tmp_path_factory.mktemp("trained") / "run", configuration, OFF, console())


@pytest.fixture
def run(trained: RunDirectory, tmp_path: Path) -> RunDirectory:
    return RunDirectory(shutil.copytree(trained.path, tmp_path / "run"))


def test_a_training_alone_gives_what_needs_no_evaluation(run: RunDirectory) -> None:
    told = console()
    draw(run, None, told)
    assert drawn(run) == NEED_NO_EVALUATION
    for name in set(FIGURES) - NEED_NO_EVALUATION:
        assert f"run: figure {name} is left out: there is no " in said(told)
    table = pd.read_csv(run.figures / "learning_curves.csv")
    first = table[table["episode"] == 1].set_index("scheme")
    assert first["learners"].to_dict() == {"proposed": 2, "re_ot": 1}  # T = 4 is another curve
    rewards = run.metrics().query("learner == 2")["accumulated_reward"]
    assert first.loc["re_ot", "iqm"] == pytest.approx(rewards.iloc[0], rel=1e-4)
    assert table["optimum"].isna().all()


def test_a_figure_that_is_named_must_be_possible(run: RunDirectory) -> None:
    with pytest.raises(InputError, match=r"figure energy: there is no evaluation\.json in"):
        draw(run, ["energy"], console())
    assert not list(run.figures.iterdir())


def test_an_evaluation_gives_all_but_the_horizons(
    run: RunDirectory, evaluation: Evaluation
) -> None:
    evaluation.save(run.path)
    told = console()
    draw(run, None, told)
    assert drawn(run) == set(FIGURES) - {"horizons"}
    assert "figure horizons is left out: it takes evaluations over two horizons" in said(told)
    table = pd.read_csv(run.figures / "learning_curves.csv")
    best = evaluation.summary["schemes"]["re_optimum"]["secrecy_sum_rate"]["mean"]
    optimum = table[table["scheme"] == "re_ot"]["optimum"]
    assert optimum.to_list() == pytest.approx([best] * 3, rel=1e-5)


def test_a_run_without_metrics_has_no_learning_curves(run: RunDirectory) -> None:
    run.metrics_file.unlink()
    with pytest.raises(InputError, match=r"learning_curves: there is no metrics\.csv in"):
        draw(run, ["learning_curves"], console())


def test_evaluations_over_other_horizons_are_found(
    run: RunDirectory, evaluation: Evaluation
) -> None:
    evaluation.save(run.path)
    summary = evaluation.summary | {"num_slots": 4}
    dataclasses.replace(evaluation, summary=summary).save(horizon_directory(run, 4))
    draw(run, ["horizons"], console())
    assert drawn(run) == {"horizons"}
    assert set(pd.read_csv(run.figures / "horizons.csv")["num_slots"]) == {4, 10}


def test_an_evaluation_over_another_horizon_bounds_no_curve(
    run: RunDirectory, evaluation: Evaluation
) -> None:
    other = evaluation.summary | {"num_slots": 4}
    dataclasses.replace(evaluation, summary=other).save(run.path)
    draw(run, ["learning_curves"], console())
    assert pd.read_csv(run.figures / "learning_curves.csv")["optimum"].isna().all()


@pytest.mark.parametrize("damage", ["cut", "[1]", "{}", "a directory"])
def test_an_evaluation_that_cannot_be_read_is_named(
    run: RunDirectory, evaluation: Evaluation, damage: str
) -> None:
    evaluation.save(run.path)
    file = run.path / "evaluation.json"
    if damage == "a directory":
        file.unlink()
        file.mkdir()
    else:
        file.write_text(json.dumps(evaluation.summary)[:50] if damage == "cut" else damage)
    for name in ("trajectories", "horizons", "learning_curves"):
        with pytest.raises(InputError, match=r"evaluation\.json: expected an evaluation in JSON"):
            draw(run, [name], console())


@pytest.mark.parametrize("damage", ["cut", "another table", "a directory"])
def test_flights_that_cannot_be_read_are_named(
    run: RunDirectory, evaluation: Evaluation, damage: str
) -> None:
    evaluation.save(run.path)
    file = run.path / "flights.parquet"
    if damage == "cut":
        file.write_bytes(file.read_bytes()[:500])
    elif damage == "another table":
        pd.DataFrame({"scheme": ["proposed"]}).to_parquet(file)
    else:
        file.unlink()
        file.mkdir()
    for name in ("trajectories", "flight_map", "energy", "offloading", "animation"):
        with pytest.raises(
            InputError, match=r"flights\.parquet: expected the flights of an evaluation in Parquet"
        ):
            draw(run, [name], console())


@pytest.mark.parametrize("damage", ["cut", "spoilt", "a directory"])
def test_of_damaged_metrics_what_can_be_read_is_drawn(run: RunDirectory, damage: str) -> None:
    content = run.metrics_file.read_bytes()
    run.metrics_file.unlink()
    if damage == "a directory":
        run.metrics_file.mkdir()
        with pytest.raises(
            InputError, match=r"metrics = '.+: expected the table that a training writes"
        ):
            draw(run, ["learning_curves"], console())
        return
    run.metrics_file.write_bytes(content[:-20] + (b"\0,what,is\nthis" * (damage == "spoilt")))
    draw(run, ["learning_curves"], console())
    assert drawn(run) == {"learning_curves"}


def test_runs_within_are_drawn_too_and_the_papers_algorithm_beside(
    run: RunDirectory, trained: RunDirectory
) -> None:
    shutil.copytree(trained.path, run.path / AS_IN_PAPER)
    within = RunDirectory(shutil.copytree(trained.path, run.path / "elsewhere"))
    draw(run, ["learning_curves"], console())
    names = set(pd.read_csv(run.figures / "learning_curves.csv")["training"])
    assert names == {"DDPG", "DDPG, as in the paper"}
    assert drawn(within) == {"learning_curves"}
    assert not list(RunDirectory(run.path / AS_IN_PAPER).figures.iterdir())


@pytest.mark.parametrize(
    "name", ["trajectories", "flight_map", "energy", "offloading", "animation"]
)
def test_flights_that_are_not_of_the_scenario_are_named(
    run: RunDirectory, evaluation: Evaluation, name: str
) -> None:
    evaluation.save(run.path)
    flights, file = evaluation.flights, run.path / "flights.parquet"
    fewer = {
        column: flights[column].str[:5] for column in ("offloading", "secrecy_rate", "ue_energy")
    }
    for changed in (flights.assign(**fewer), flights.assign(scheme="unknown")):
        changed.to_parquet(file)
        with pytest.raises(InputError, match=r"flights\.parquet: expected flights over 10 UEs"):
            draw(run, [name], console())


def test_an_evaluation_that_does_not_count_its_learners_is_named(
    run: RunDirectory, evaluation: Evaluation
) -> None:
    evaluation.save(run.path)
    for result in (summary := json.loads(json.dumps(evaluation.summary)))["schemes"].values():
        del result["learners"]
    (run.path / "evaluation.json").write_text(json.dumps(summary))
    with pytest.raises(InputError, match=r"evaluation\.json: expected an evaluation in JSON"):
        draw(run, ["horizons"], console())
