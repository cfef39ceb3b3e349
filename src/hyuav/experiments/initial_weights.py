"""The weights that a training begins with: those saved before, or chosen as in the paper."""

import dataclasses
from collections.abc import Callable, Iterable
from pathlib import Path

import torch
from torch import Tensor

from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.learning.checkpoint import load_weights_file
from hyuav.learning.learners import Learner
from hyuav.learning.training import Episode, Training
from hyuav.learning.weights import select_learners


def saved_weights(path: str | Path) -> dict[str, Tensor]:
    """The weights in a checkpoint, or the best weights of a run directory.

    Raises:
        InputError: there are none, or the file is truncated or foreign.
    """
    path = Path(path)
    file = RunDirectory(path).best_checkpoint if path.is_dir() else path
    return load_weights_file(file)


def select_initial_weights(
    configuration: RunConfiguration,
    candidates: int,
    episodes: int,
    *,
    device: str | None = None,
    track: Callable[[Iterable[Episode]], Iterable[Episode]] = iter,
) -> tuple[dict[str, Tensor], list[float]]:
    """Begin where a higher reward was reached: the best flyer of a few short trainings.

    The paper sets its initial weights so. For each seed of the training, every mode rule trains its
    candidates, and a learner of that seed begins with whichever of them, of any rule, earns most
    under the learner's own rule. They are judged as best weights are, without noise and on the
    training's evaluation fading.

    Args:
        configuration: of the training to come; N is its number of learners.
        candidates: short trainings for each of its mode rules and seeds.
        episodes: of each candidate.
        device: to train on.
        track: passes on the episodes one by one, as what shows the progress does.

    Returns:
        the chosen candidates' weights, and what they earn (N,).
    """
    learners = configuration.learners
    rules = tuple(dict.fromkeys(learner.scheme for learner in learners))
    seeds = tuple(dict.fromkeys(learner.seed for learner in learners))
    owners = [seed for seed in seeds for _ in rules for _ in range(candidates)]
    training = Training(
        configuration.scenario,
        [
            Learner(rule, seed * candidates + candidate)
            for seed in seeds
            for rule in rules
            for candidate in range(candidates)
        ],
        configuration.algorithm,
        dataclasses.replace(configuration.training, num_episodes=episodes),
        device,
        configuration.reward,
    )
    for _ in track(training.episodes()):
        pass
    weights = training.best_weights
    training.load_weights(weights)
    earned = {rule: training.evaluate(rule).reward for rule in rules}
    chosen, best = [], []
    for learner in learners:
        own = torch.tensor([owner == learner.seed for owner in owners])
        reached = earned[learner.scheme].where(own, -torch.inf)
        chosen.append(int(reached.argmax()))
        best.append(float(reached.max()))
    return select_learners(weights, chosen), best
