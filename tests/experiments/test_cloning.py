"""Actors that begin by imitating the generalist."""

import dataclasses

import pytest

from hyuav.experiments import cloning
from hyuav.experiments.cloning import cloned_weights
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.sac import SAC
from hyuav.learning.training import Training
from sample_runs import ONE_OF_EACH


@pytest.mark.parametrize("algorithm", [ONE_OF_EACH.algorithm, SAC(hidden_sizes=(64,))])
def test_clones_earn_more_than_what_begins_fresh(
    algorithm: AlgorithmParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cloning, "STEPS", 300)
    configuration = dataclasses.replace(
        ONE_OF_EACH,
        algorithm=dataclasses.replace(algorithm, hidden_sizes=(64, 64), clock=True),
    )
    training = Training(
        configuration.scenario,
        configuration.learners,
        configuration.algorithm,
        configuration.training,
    )
    fresh = training.evaluate().reward
    training.warm_start(cloned_weights(configuration))
    assert (training.best_evaluation > fresh).all()
