import dataclasses
import os
from pathlib import Path

import pytest

from hyuav import InputError, Scenario
from hyuav.experiments.metrics_file import MetricsFile
from hyuav.experiments.run_directory import (
    METRIC_COLUMNS,
    RunConfiguration,
    RunDirectory,
    named_algorithm,
    named_scenario,
    readable_metrics,
)
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3
from hyuav.learning.train import Learner
from hyuav.learning.training import TrainingParameters

CONFIGURATION = RunConfiguration(
    "custom",
    dataclasses.replace(Scenario.preset("two_clusters"), num_slots=7, noise_power=2.5e-13),
    (Learner("hybrid", 11), Learner("jamming", 11, 12)),
    "td3",
    TD3(hidden_sizes=(5,), actor_every=3),
    TrainingParameters(num_episodes=2),
)


def test_a_run_remembers_its_configuration_without_loss(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path / "run", CONFIGURATION)
    assert run.configuration() == CONFIGURATION


def test_a_run_never_overwrites_another(tmp_path: Path) -> None:
    RunDirectory.create(tmp_path, CONFIGURATION)
    with pytest.raises(InputError, match=r"run directory = .*: expected one without a run in it"):
        RunDirectory.create(tmp_path, CONFIGURATION)


def test_a_run_in_the_place_of_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a writable place"):
        RunDirectory.create(tmp_path / "file", CONFIGURATION)


@pytest.mark.parametrize(
    "content",
    [
        None,
        "",
        "- 1",
        "seed: 3",
        "a: [",
        "seed: !!int many",
        "scenario: {name: x}\nlearners: [{scheme: hybrid}]",
        "\x00\xff",
    ],
)
def test_a_directory_that_is_no_run_is_refused_in_one_line(
    tmp_path: Path, content: str | None
) -> None:
    if content is not None:
        (tmp_path / "config.yaml").write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=r"^[^\n]+$"):
        RunDirectory(tmp_path).configuration()


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("learners", [{"scheme": "both"}]),
        ("learners", "hybrid"),
        ("learners", ["hybrid"]),
        ("learners", []),
        ("learners", [{"seed": "many"}]),
        ("learners", [{"seed": -1}]),
        ("learners", [{"num_slots": 0}]),
        ("learners", [{"scheme": "relay"}, {"scheme": "relay"}]),
        ("algorithm", {"name": "ppo"}),
        ("algorithm", "ddpg"),
        ("algorithm", {"name": "ddpg", "discount": 2}),
        ("training", 3),
        ("training", {"num_episodes": 0}),
        ("scenario", 4),
        ("scenario", "nowhere"),
        ("scenario", {"name": "custom"}),
    ],
)
def test_a_bad_entry_of_a_configuration_is_named(entry: str, value: object) -> None:
    with pytest.raises(InputError, match=rf"^[^\n]*{entry.rstrip('s')}|^[^\n]*(discount|num_ep)"):
        RunConfiguration.from_dict({**CONFIGURATION.to_dict(), entry: value})


def test_a_scenario_may_name_a_preset_and_change_it() -> None:
    name, scenario = named_scenario({"name": "random_disk", "num_slots": 5})
    assert name == "random_disk"
    assert scenario == dataclasses.replace(Scenario.preset("random_disk"), num_slots=5)


def test_an_algorithm_is_chosen_by_name() -> None:
    assert named_algorithm({"name": "sac", "discount": 0.9}) == ("sac", SAC(discount=0.9))
    for name, algorithm in ALGORITHMS.items():
        assert named_algorithm({"name": name}) == (name, algorithm())


def test_metrics_can_be_read_while_they_are_written(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path)
    file = MetricsFile(run.metrics_file, METRIC_COLUMNS)
    file.append([{"episode": 1, "scheme": "relay"}])
    file.append([{"episode": 2, "scheme": "relay", "evaluation": 3.5}])
    table = run.metrics()
    assert table["episode"].tolist() == [1, 2]
    assert table["evaluation"].isna().tolist() == [True, False]
    file.close()


@pytest.mark.parametrize(
    "content",
    [
        *(b"", bytes(range(256)) * 20, b"a,b\n1,2\n"),
        (",".join(METRIC_COLUMNS) + "\n1,20,0,best,3,20,1.5,,,,0.1\n").encode(),
        (",".join(METRIC_COLUMNS) + "\n1,20,0,relay,3,20,high,,,,0.1\n").encode(),
        (",".join(METRIC_COLUMNS) + "\n1,20,0,relay,3,20,True,,,,0.1\n").encode(),
    ],
)
def test_metrics_that_no_training_wrote_are_refused_in_one_line(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "metrics.csv").write_bytes(content)
    with pytest.raises(InputError, match=r"^metrics = '[^\n]*: expected the table [^\n]*$"):
        RunDirectory(tmp_path).metrics()


def test_metrics_are_read_from_files_only(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.csv"
    os.mkfifo(metrics)
    with pytest.raises(InputError, match="not a file"):
        RunDirectory(tmp_path).metrics()
    assert readable_metrics(metrics).empty
    metrics.unlink()
    metrics.mkdir()
    with pytest.raises(InputError, match="not a file"):
        RunDirectory(tmp_path).metrics()


HEADER = ",".join((*METRIC_COLUMNS, "loss_critic"))
ROW = "{episode},20,0,hybrid,3,20,1.5,,,,0.1,0.25"


def _write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_metrics_are_read_as_they_were_written(tmp_path: Path) -> None:
    rows = "".join(f"{ROW.format(episode=episode)}\n" for episode in (1, 2))
    metrics = readable_metrics(_write(tmp_path / "metrics.csv", f"{HEADER}\n{rows}"))
    assert metrics["episode"].tolist() == [1, 2]
    assert metrics["scheme"].tolist() == ["hybrid"] * 2
    assert metrics["loss_critic"].tolist() == [0.25] * 2
    assert metrics["evaluation"].isna().all()


@pytest.mark.parametrize("cut", range(1, len(ROW.format(episode=12)) + 1, 3))
def test_a_row_that_is_being_written_is_left_out(cut: int, tmp_path: Path) -> None:
    whole = f"{HEADER}\n{ROW.format(episode=11)}\n"
    path = _write(tmp_path / "metrics.csv", whole + ROW.format(episode=12)[:cut])
    assert readable_metrics(path)["episode"].tolist() == [11]


@pytest.mark.parametrize("text", ["", "epis", HEADER, f"{HEADER}\n", "\n\n", "\0\0\n"])
def test_metrics_without_a_whole_row_are_empty(text: str, tmp_path: Path) -> None:
    metrics = readable_metrics(_write(tmp_path / "metrics.csv", text))
    assert len(metrics) == 0
    assert set(METRIC_COLUMNS) <= set(metrics.columns)


def test_metrics_that_are_missing_are_empty(tmp_path: Path) -> None:
    assert len(readable_metrics(tmp_path / "none.csv")) == 0


def test_damaged_rows_are_left_out(tmp_path: Path) -> None:
    good = ROW.format(episode=1)
    lines = [HEADER, good, "what is this", f"{good},7,8,9", '"\xff,3', good.replace("1", "x", 1)]
    path = tmp_path / "metrics.csv"
    path.write_bytes("\n".join([*lines, ""]).encode("latin-1"))
    assert readable_metrics(path)["episode"].tolist() == [1]
