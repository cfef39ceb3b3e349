"""Words that a recipe does not have: the line says which may have been meant, and where."""

from pathlib import Path

import pytest

from recipe_calls import Refusal

UNKNOWN = {
    "num_episodes=10": "configuration: unknown field 'num_episodes': 'training.num_episodes'",
    "+num_episodes=10": "configuration: unknown field 'num_episodes': 'training.num_episodes'",
    "jamming_power=1": "configuration: unknown field 'jamming_power': 'scenario.jamming_power'",
    "training.hidden_sizes=[8]": "training: unknown field 'hidden_sizes': 'algorithm.hidden_sizes'",
    "scenario.ue_powr=1": "scenario: unknown field 'ue_powr': 'ue_power'",
    "episodez=3": "configuration: unknown field 'episodez': 'training.num_episodes'",
    "output=here": "configuration: unknown field 'output': 'hydra.run.dir'",
    "seeds=3": "configuration: unknown field 'seeds': 'learners'",
}


def test_a_word_is_looked_for_in_all_groups(refusal: Refusal) -> None:
    for argument, line in UNKNOWN.items():
        told = refusal("train", argument)
        assert told.replace("did you mean ", "") == f"error: {line}?\n"
    line = refusal("train", "training.scheme=relay")
    assert line.endswith("did you mean 'scheme', without 'training' before it?\n")


@pytest.mark.parametrize(
    ("word", "now"),
    [
        ("warm_up_episodes", "warm_up_episodes"),
        ("imagined_flights", "imagined_flights"),
        ("alternatives_weight", "imitation_weight"),
    ],
)
def test_a_word_that_has_moved_is_found_where_it_is_now(
    refusal: Refusal, word: str, now: str
) -> None:
    told = refusal("train", "algorithm=ddpg_robust", f"algorithm.{word}=3")
    assert told.endswith(f"unknown field '{word}': did you mean 'algorithm.guide.{now}'?\n")
    told = refusal("train", f"algorithm.{word}=3")
    place = f"'algorithm.guide.{now}' of algorithm=ddpg_robust"
    assert told.endswith(f"unknown field '{word}': did you mean {place}?\n")


def test_the_number_of_ues_is_not_taken_for_the_number_of_slots(refusal: Refusal) -> None:
    told = refusal("train", "scenario.num_ues=12")
    assert told.startswith("error: scenario: unknown field 'num_ues': ")
    assert "mean 'num_slots'" not in told


UNREADABLE = [
    ("evaluate", "run=runs/lr=0.1", "write it in quotation marks: 'run=\"runs/lr=0.1\"'"),
    ("evaluate", "run=[runs/lr=1,b]", "write it in quotation marks: 'run=[\"runs/lr=1\",b]'"),
    ("train", "hydra.run.dir=läufe/1", "write it in quotation marks: 'hydra.run.dir=\"läufe/1\"'"),
    ("report", "run=a'b", "write it in quotation marks: 'run=\"a'\"'\"'b\"'"),
    ("train", "scenario.ue_positions=[[1,2]", "no viable alternative at input '[[1,2]'"),
    ("evaluate", "run=a,b", "'run=[a,b]' is a list, 'run=\"a,b\"' one text"),
    ("train", "algorithm=ddpg,td3", "expected one of them, and -m does a job for each"),
    ("train", "two_clusters", "expected NAME=VALUE (did you mean 'scenario=two_clusters'?)"),
    ("evaluate", "runs/NAME", "expected NAME=VALUE (did you mean 'run=runs/NAME'?)"),
    ("train", "scheme", "expected NAME=VALUE"),
    ("train", "=3", "expected NAME=VALUE"),
    ("evaluate", "hydra.mode=MULTIRUN", "this recipe does a single job: leave it out"),
]


@pytest.mark.parametrize(("recipe", "word", "line"), UNREADABLE)
def test_a_word_that_cannot_be_read_is_told_as_it_is_written(
    refusal: Refusal, recipe: str, word: str, line: str
) -> None:
    told = refusal(recipe, word)
    assert told.startswith("error: ")
    assert told.endswith(f": {line}\n")


def test_the_home_is_told_in_full(refusal: Refusal) -> None:
    told = refusal("evaluate", "run=~/runs/one")
    assert told.endswith(f"quotation marks: 'run=\"{Path.home() / 'runs' / 'one'}\"'\n")


def test_a_word_with_dashes_and_one_in_capitals_are_told_too(refusal: Refusal) -> None:
    told = refusal("train", "--seed=3")
    assert (
        told == "error: unrecognized arguments: --seed=3 (NAME=VALUE is written without dashes)\n"
    )
    assert refusal("train", "algorithm=DDPG").endswith("(did you mean 'ddpg'?)\n")


def test_a_training_in_the_way_is_told_how_to_go_on_with(refusal: Refusal, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "config.yaml").write_text("learners: []\n")
    told = refusal("train", "hydra.run.dir=run")
    assert told.endswith("a run in it (train resume=DIRECTORY goes on with one)\n")
