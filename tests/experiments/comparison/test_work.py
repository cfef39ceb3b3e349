"""A comparison from Python."""

from pathlib import Path

import pytest

from hyuav import Compare, EvaluationParameters, InputError, TrainingParameters, compare

OPTIONS = Compare(
    algorithm=("ddpg",),
    scenario=("two_clusters",),
    scheme=("relay",),
    num_slots=(4,),
    learners=2,
    workers=1,
)
TRAINING = TrainingParameters(
    num_episodes=2, batch_size=4, evaluation_every=1, evaluation_episodes=3, compile="never"
)
EVALUATION = EvaluationParameters(episodes=4, resolution=10.0)


def test_it_gives_its_tables_and_goes_on_in_the_same_directory(tmp_path: Path) -> None:
    summary = compare(tmp_path / "here", OPTIONS, TRAINING, EVALUATION)
    assert summary.results["seed"].tolist() == [0, 1]
    assert summary.algorithms["algorithm"].tolist() == ["ddpg"]
    assert (tmp_path / "here" / "summary.json").exists()
    trained = next((tmp_path / "here" / "shards").iterdir()).stat().st_mtime_ns
    again = compare(tmp_path / "here", OPTIONS, TRAINING, EVALUATION)
    assert again.results.equals(summary.results)
    assert next((tmp_path / "here" / "shards").iterdir()).stat().st_mtime_ns == trained


def test_another_comparisons_directory_is_refused(tmp_path: Path) -> None:
    compare(tmp_path, OPTIONS, TRAINING, EVALUATION)
    with pytest.raises(InputError, match=r"output = .*: expected a comparison with .*episodes = 5"):
        compare(tmp_path, OPTIONS, TRAINING, EvaluationParameters(episodes=5, resolution=10.0))
