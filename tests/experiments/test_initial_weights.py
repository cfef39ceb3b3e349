from pathlib import Path

import pytest

from hyuav import InputError
from hyuav.experiments.initial_weights import saved_weights, select_initial_weights
from hyuav.experiments.train import train
from hyuav.learning.training import Training
from sample_runs import ONE_OF_EACH, SILENT, UNLOGGED


def test_training_begins_with_the_candidates_that_earn_most_under_each_scheme() -> None:
    weights, earned = select_initial_weights(ONE_OF_EACH, candidates=3, episodes=2)
    alone = Training(
        ONE_OF_EACH.scenario,
        ONE_OF_EACH.learners,
        ONE_OF_EACH.algorithm,
        ONE_OF_EACH.training,
    )
    alone.warm_start(weights)
    assert alone.best_evaluation.tolist() == pytest.approx(earned, abs=0.3)  # other draws
    assert earned[0] >= max(earned[1:]) - 0.3  # hybrid may always do as the others do


def test_the_best_weights_are_never_worse_than_the_initial_ones(tmp_path: Path) -> None:
    weights, earned = select_initial_weights(ONE_OF_EACH, candidates=2, episodes=2)
    run = train(tmp_path / "run", ONE_OF_EACH, UNLOGGED, SILENT, initial_weights=weights)
    best = run.metrics()["best_evaluation"].dropna().tail(3)
    assert all(after >= before - 0.3 for after, before in zip(best, earned, strict=True))


def test_weights_come_from_a_checkpoint_or_from_a_run(tmp_path: Path) -> None:
    run = train(tmp_path / "run", ONE_OF_EACH, UNLOGGED, SILENT)
    from_run, from_file = saved_weights(run.path), saved_weights(run.best_checkpoint)
    assert from_run.keys() == from_file.keys()
    with pytest.raises(InputError, match=r"checkpoint = .*: expected a checkpoint of kind"):
        saved_weights(run.last_checkpoint)
