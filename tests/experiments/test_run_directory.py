import dataclasses
from pathlib import Path

import pytest

from hyuav import InputError, Scenario
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory, named_algorithm
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3
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


def test_an_algorithm_is_chosen_by_name() -> None:
    assert named_algorithm({"name": "sac", "discount": 0.9}) == ("sac", SAC(discount=0.9))
    for name, algorithm in ALGORITHMS.items():
        assert named_algorithm({"name": name}) == (name, algorithm())
