import dataclasses
import io
import json
from pathlib import Path
from typing import Any

import pytest
import torch
from rich.console import Console

from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import EvaluationLoggerParameters, LoggerParameters, log_evaluation
from hyuav.experiments.train import train
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.references.flight import FlightPolicy
from hyuav.references.straight import ja_lt, re_lt
from offline_wandb import history, offline_runs, recorded, summary
from recipe_calls import TINY_COMPARISON, TINY_TRAINING, Call

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)
CONFIGURATION = RunConfiguration(
    "two_clusters",
    SCENARIO,
    (Learner("relay"),),
    "ddpg",
    DDPG(hidden_sizes=(8,)),
    TrainingParameters(num_episodes=2, batch_size=8, evaluation_episodes=3),
)
SILENT = Console(file=io.StringIO())
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63f8"
    "cfc0000003010100c9fe92ef0000000049454e44ae426082"
)


def evaluated() -> Evaluation:
    parameters = EvaluationParameters(episodes=3, flights=2)
    return evaluate(SCENARIO, "two_clusters", {"re_lt": re_lt(SCENARIO)}, parameters)


def table(directory: Path, record: dict[str, Any], name: str) -> dict[str, Any]:
    assert record[f"{name}/_type"] == "table-file"
    return dict(json.loads((directory / "files" / record[f"{name}/path"]).read_text()))


def test_each_of_several_helpers_is_logged_with_the_upper_bound(tmp_path: Path) -> None:
    two = dataclasses.replace(Scenario.preset("contested"), num_slots=5)
    parameters = EvaluationParameters(episodes=3, flights=1)
    path = torch.zeros(two.num_slots + 1, 2, 2)
    best = FlightPolicy(path, two, upper_bound=100.0)
    evaluation = evaluate(two, "contested", {"ja_lt": ja_lt(two), "ja_optimum": best}, parameters)
    logger = EvaluationLoggerParameters(mode="offline")
    log_evaluation(tmp_path, evaluation, [], logger, SILENT)
    (file,) = offline_runs(tmp_path)
    told, (record,) = summary(file), history(file)
    found = evaluation.summary["schemes"]["ja_lt"]
    for name in ("fraction_of_upper_bound", "relay_share_1", "off_map_1", "helper_energy_2"):
        assert told[f"ja_lt/{name}"] == pytest.approx(found[name])
    assert {"x_1", "relay_2", "way"} < set(table(file.parent, record, "flights")["columns"])


def test_an_evaluation_is_logged_beside_its_training(tmp_path: Path) -> None:
    logger = LoggerParameters(project="offloading", group="paper")
    run = train(tmp_path / "run", CONFIGURATION, logger, SILENT)
    (training,) = offline_runs(run.path)
    (run.figures / "flight_map.png").write_bytes(PIXEL)
    (run.path / "report.html").write_text("<p>what came of it</p>")
    evaluation = evaluated()
    log_evaluation(run.path, evaluation, [run], EvaluationLoggerParameters(), SILENT)
    file = next(own for own in offline_runs(run.path) if own != training)
    (identity,), (trained,) = recorded(file, "run"), recorded(training, "run")
    assert (identity.project, identity.run_group) == ("offloading", "paper")
    assert identity.job_type == "evaluate"
    assert identity.run_id != trained.run_id
    config = {each.key: json.loads(each.value_json) for each in identity.config.update}
    assert config["models"] == [f"offloading/model-{trained.run_id}:best"]
    (record,) = history(file)
    schemes, flights = (table(file.parent, record, name) for name in ("schemes", "flights"))
    rate = evaluation.summary["schemes"]["re_lt"]["secrecy_sum_rate"]["mean"]
    assert schemes["data"][0][:2] == ["Re-LT", pytest.approx(rate)]
    assert flights["columns"] == list(evaluation.flights.columns)
    assert len(flights["data"]) == 2 * 10
    image = file.parent / "files" / record["figures/flight_map/path"]
    assert image.read_bytes() == PIXEL
    report = file.parent / "files" / record["report/path"]
    assert "what came of it" in report.read_text()
    assert summary(file)["re_lt/secrecy_sum_rate"] == pytest.approx(rate)


def test_an_evaluation_of_a_training_that_was_not_logged_is_not_logged(tmp_path: Path) -> None:
    run = train(tmp_path / "run", CONFIGURATION, LoggerParameters(mode="disabled"), SILENT)
    log_evaluation(run.path, evaluated(), [run], EvaluationLoggerParameters(), SILENT)
    assert not (run.path / "wandb").exists()
    asked = EvaluationLoggerParameters(mode="offline")
    log_evaluation(tmp_path / "there", evaluated(), [RunDirectory(run.path)], asked, SILENT)
    assert len(offline_runs(tmp_path / "there")) == 1


def test_the_command_line_counts_more_than_the_environment(
    call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("WANDB_MODE", "disabled")
    monkeypatch.setenv("WANDB_PROJECT", "theirs")
    tiny = (*TINY_TRAINING, "algorithm.hidden_sizes=[8]", "scenario.num_slots=5")
    call("train", "hydra.run.dir=unasked", *tiny)
    assert not (tmp_path / "unasked" / "wandb").exists()
    call("train", "hydra.run.dir=asked", "logger.mode=offline", *tiny)
    (file,) = offline_runs(tmp_path / "asked")
    assert recorded(file, "run")[0].project == "theirs"


def test_the_trainings_of_a_comparison_are_a_group_and_it_is_one_of_them(
    call: Call, tmp_path: Path
) -> None:
    call(
        "compare",
        "algorithm=[ddpg,sac]",
        "scenario=two_clusters",
        "scheme=relay",
        "logger.mode=offline",
        *TINY_COMPARISON,
    )
    runs = [recorded(file, "run")[0] for file in offline_runs(tmp_path / "here")]
    assert {(run.display_name, run.job_type) for run in runs} == {
        ("ddpg_two_clusters_T8", "train"),
        ("sac_two_clusters_T8", "train"),
        ("here", "comparison"),
    }
    assert {run.run_group for run in runs} == {"here"}
    logged = [history(file)[-1] for file in offline_runs(tmp_path / "here")]
    (comparison,) = (record for record in logged if "algorithms/path" in record)
    assert comparison["figures/cells/_type"] == "image-file"
    for file in offline_runs(tmp_path / "here"):
        for artifact in recorded(file, "artifact"):
            assert all(Path(own.local_path).is_file() for own in artifact.manifest.contents)
