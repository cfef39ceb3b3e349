"""What the recipes do: train into a run directory, gather the schemes, tell what came of it."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from torch import Tensor

from hyuav._support.errors import Halted, InputError, rejection
from hyuav._support.interruption import Interruption
from hyuav._support.terminal import make_progress, print_line
from hyuav.experiments.evaluation import LABELS, OPTIMA, Policy
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory, require_writable
from hyuav.experiments.tracking import LoggerParameters, Tracker
from hyuav.experiments.tracking.checkpoints import Reported, first_checkpoint, restore
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.checkpoint import load_weights_file
from hyuav.learning.policy import LearnedPolicy
from hyuav.learning.train import Learner
from hyuav.learning.training import Episode, Training
from hyuav.learning.weights import count_learners, join_learners, select_learner
from hyuav.physics.scenario import Scenario
from hyuav.references.optimum import FlightPolicy, solve
from hyuav.references.straight import ConstantVelocity, ja_lt, re_lt

LEARNED = {"hybrid": "proposed", "relay": "re_ot", "jamming": "ja_ot"}
"""The learned scheme for each rule of who chooses the mode."""

LEARNED_AS_IN_PAPER = {rule: f"{scheme}_paper" for rule, scheme in LEARNED.items()}
"""The same by the paper's own algorithm, where another one is beside it."""

LINEAR: dict[str, Callable[[Scenario], ConstantVelocity]] = {"re_lt": re_lt, "ja_lt": ja_lt}


def train(
    directory: str | Path,
    configuration: RunConfiguration,
    logger: LoggerParameters,
    console: Console,
    *,
    device: str | None = None,
    initial_weights: dict[str, Tensor] | None = None,
    request: Mapping[str, Any] | None = None,
    logs: Path | None = None,
) -> RunDirectory:
    """Train as configured, reporting to a new run directory.

    Args:
        directory: of the run.
        configuration: of the training.
        logger: what Weights & Biases gets.
        console: to show progress on.
        device: to train on.
        initial_weights: to begin with, instead of fresh ones.
        request: all that was asked for, to be kept with the run.
        logs: directory for the files of Weights & Biases; the run's where it is None.

    Raises:
        InputError: the directory is taken, or the checkpoint does not fit.
        Interrupted: a signal asked to stop; :func:`resume` goes on.
        Halted: the training cannot go on.
    """
    training = new_training(configuration, device)
    if initial_weights is not None:
        training.warm_start(initial_weights)
    run = RunDirectory(directory)
    require_writable("run directory", run.path)
    with run.reserved():
        RunDirectory.create(directory, configuration, request, first_checkpoint(training))
        _train(run, configuration, training, logger, console, logs)
    return run


def resume(
    directory: str | Path,
    logger: LoggerParameters,
    console: Console,
    *,
    device: str | None = None,
    logs: Path | None = None,
) -> RunDirectory:
    """Go on with a training from its last checkpoint, in its directory and its W&B run.

    What comes of it is what would have come of the training without a break.

    Args:
        directory: of the run.
        logger: what Weights & Biases gets.
        console: to show progress on.
        device: to train on.
        logs: directory for the files of Weights & Biases; the run's where it is None.

    Raises:
        InputError: there is no such run, or no checkpoint of it, or it cannot be written to.
        Interrupted: a signal asked to stop.
        Halted: the training cannot go on.
    """
    run = RunDirectory(directory)
    configuration = run.configuration()
    require_writable("run directory", run.path)
    with run.reserved():
        try:
            training, reported = restore(run, lambda: new_training(configuration, device))
        except OSError as error:
            raise Halted(f"nothing is done: {_cause(error)}") from error
        rest = f"goes on after episode {training.episode} of {training.parameters.num_episodes}"
        told = "is finished" if training.is_finished else rest
        print_line(f"{run.path}: this training {told}", console)
        _train(run, configuration, training, logger, console, logs, reported)
    return run


def _train(
    run: RunDirectory,
    configuration: RunConfiguration,
    training: Training,
    logger: LoggerParameters,
    console: Console,
    logs: Path | None,
    reported: Reported | None = None,
) -> None:
    """Train to the end, or stop after an episode where that is asked for."""
    episodes = training.parameters.num_episodes
    with Interruption() as interruption:
        try:
            with Tracker(run, configuration, training, logger, console, logs, reported) as tracker:
                if training.is_finished:
                    tracker.save()  # the best weights may be damaged
                for episode in training.episodes():
                    tracker.log(episode)
                    if interruption.requested:
                        tracker.save()
                        break
                interruption.raise_if_requested(
                    f"interrupted after episode {training.episode} of {episodes}"
                )
        except OSError as error:
            line = f"halted after episode {training.episode} of {episodes}: {_cause(error)}"
            raise Halted(f"{line}; the last checkpoint is kept") from error
        interruption.raise_if_requested("interrupted after the last episode")
    if all(training.stopped):
        line = f"halted after episode {training.episode} of {episodes}: every learner has stopped"
        raise Halted(line, resumable=False)


def _cause(error: OSError) -> str:
    return f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror)


def train_or_resume(
    directory: str | Path,
    configuration: RunConfiguration,
    logger: LoggerParameters,
    console: Console,
    *,
    device: str | None = None,
    initial_weights: Callable[[], dict[str, Tensor] | None] = lambda: None,
    request: Mapping[str, Any] | None = None,
) -> RunDirectory:
    """Train as configured, or go on with that training where it has begun in the directory.

    It is that training if it was configured in the same way and began with the same weights.

    Args:
        directory: of the run.
        configuration: of the training.
        logger: what Weights & Biases gets.
        console: to show progress on.
        device: to train on.
        initial_weights: finds what a new training begins with; None for fresh weights.
        request: all that was asked for, to be kept with a new run. Its ``warm_start`` names what
            the training begins with.

    Raises:
        InputError: another training is there, or as :func:`train` and :func:`resume`.
        Interrupted: a signal asked to stop.
        Halted: the training cannot go on.
    """
    run = RunDirectory(directory)
    if run.exists and _is_of(run, configuration, request or {}):
        return resume(directory, logger, console, device=device)
    return train(
        directory,
        configuration,
        logger,
        console,
        device=device,
        initial_weights=None if run.exists else initial_weights(),
        request=request,
    )


def _is_of(run: RunDirectory, configuration: RunConfiguration, request: Mapping[str, Any]) -> bool:
    """Whether that training was begun in a run's directory."""
    try:
        same_start = run.request().get("warm_start") == request.get("warm_start")
        return same_start and run.configuration() == configuration
    except InputError:  # of a comparison, perhaps
        return False


def new_training(configuration: RunConfiguration, device: str | None = None) -> Training:
    """The training that is configured, of which nothing is done yet.

    Args:
        configuration: of the training.
        device: to train on.

    Raises:
        InputError: as :class:`hyuav.learning.training.Training`.
    """
    return Training(
        configuration.scenario,
        configuration.learners,
        configuration.algorithm,
        configuration.training,
        device,
    )


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

    The paper sets its initial weights so. For each seed of the training, every scheme trains its
    candidates, and a learner of that seed begins with whichever of them, of any scheme, earns most
    under the learner's own scheme. They are judged as best weights are, without noise and on the
    training's evaluation fading.

    Args:
        configuration: of the training to come; N is its number of learners.
        candidates: short trainings for each of its schemes and seeds.
        episodes: of each candidate.
        device: to train on.
        track: passes on the episodes one by one, as what shows the progress does.

    Returns:
        the chosen candidates' weights, and what they earn (N,) in bps/Hz.
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
        chosen.append(select_learner(weights, int(reached.argmax())))
        best.append(float(reached.max()))
    return join_learners(chosen), best


def learned_policy(
    scenario: Scenario,
    algorithm: AlgorithmParameters,
    weights: dict[str, Tensor],
    learners: Sequence[int],
) -> Policy:
    """The noise-free actors of some learners, in the environment that they were trained in.

    Args:
        scenario: to fly.
        algorithm: with which they were trained.
        weights: of all learners, as a training saves them.
        learners: which of them.

    Raises:
        InputError: the weights do not fit the algorithm or the number of UEs.
    """
    module = LearnedPolicy(scenario, algorithm, weights, learners)
    return Policy(module, len(learners), algorithm.clock, algorithm.geofence)


def learned_policies(
    runs: Sequence[RunDirectory], scenario: Scenario, schemes: Mapping[str, str] = LEARNED
) -> dict[str, list[Policy]]:
    """The best actors of trainings for the scenario's horizon, as Proposed, Re-OT and Ja-OT.

    Args:
        runs: of the trainings.
        scenario: to fly.
        schemes: that the actors count as, by the rule of who chooses the mode.

    Raises:
        InputError: a run or its checkpoint cannot be read, its actors observe another number of
            UEs than the scenario has, or none was trained for the horizon.
    """
    policies: dict[str, list[Policy]] = {}
    horizons: set[int] = set()
    for run in runs:
        configuration, weights = run.configuration(), run.best_weights()
        algorithm = configuration.algorithm
        if count_learners(weights) != len(configuration.learners):
            accepted = f"weights of {len(configuration.learners)} learners"
            raise InputError(rejection("checkpoint", str(run.best_checkpoint), accepted))
        by_scheme: dict[str, list[int]] = {}
        for index, learner in enumerate(configuration.learners):
            horizon = learner.num_slots or configuration.scenario.num_slots
            horizons.add(horizon)
            if horizon == scenario.num_slots:
                by_scheme.setdefault(schemes[learner.scheme], []).append(index)
        for scheme, indices in by_scheme.items():
            policy = learned_policy(scenario, algorithm, weights, indices)
            policies.setdefault(scheme, []).append(policy)
    if not policies:
        accepted = f"what learners were trained for, {', '.join(map(str, sorted(horizons)))}"
        raise InputError(rejection("num_slots", scenario.num_slots, accepted))
    return policies


def reference_policies(
    scenario: Scenario, resolution: float, console: Console
) -> dict[str, list[Policy]]:
    """Re-LT, Ja-LT and the exact optimum of each mode rule.

    A straight flight that is too fast for the horizon is left out, and the console says so.

    Args:
        scenario: to fly.
        resolution: of the optimum's grid in m.
        console: for what is left out, and for the progress.
    """
    policies = {}
    for name, scheme in LINEAR.items():
        try:
            policies[name] = [Policy(scheme(scenario))]
        except InputError as error:
            print_line(f"{LABELS[name]} is left out: {error}", console)
    with make_progress(console, "optima") as progress:
        optima = solve(scenario, resolution=resolution, track=progress.track)
    for rule, optimum in optima.items():
        policies[OPTIMA[rule]] = [Policy(FlightPolicy(optimum.path, scenario))]
    return policies
