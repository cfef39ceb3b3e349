"""Do the main job: train the learned schemes, evaluate, draw.

The schemes are Proposed, Re-OT and Ja-OT, each trained twice: by the robust variant of DDPG, and
exactly as in the paper; Proposed once more with the helper's power. Straight flights, no helper and
the best possible flights are set beside them.

hyuav reproduce
hyuav reproduce scenario=random_disk training.num_episodes=600
hyuav reproduce seeds=10 num_slots=[10,15,20] also=random_disk
hyuav reproduce figures=[learning_curves,trajectories]
hyuav reproduce hydra.run.dir=runs/NAME
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass as pydantic_dataclass
from rich.console import Console
from torch import Tensor

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    OneOrMore,
    Parameters,
    Text,
    Threads,
    parameter,
)
from hyuav._support.terminal import make_progress, print_line
from hyuav.envs.rewards import SUM_RATE
from hyuav.experiments.command_line import same_call
from hyuav.experiments.configuration import Config, recipe, section, telling_how_to_go_on
from hyuav.experiments.elsewhere import horizon_directory
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.experiments.evaluation_table import print_results
from hyuav.experiments.initial_weights import select_initial_weights
from hyuav.experiments.policies import Policies, learned_policies, references
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.schemes import (
    LABELS,
    LEARNED_AS_IN_PAPER,
    LEARNED_WITH_POWER,
    PROPOSED_POWER,
    SCHEMES,
)
from hyuav.experiments.tracking import LoggerParameters, log_evaluation, part_of
from hyuav.experiments.train import train_or_resume
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.scenario import PRESETS, Preset, Scenario
from hyuav.references.optimum import usable_resolution
from hyuav.viz.data.runs import AS_IN_PAPER, WITH_POWER
from hyuav.viz.html.page import write_report
from hyuav.viz.paper.gallery import FigureName, draw

Seeds = Annotated[int, Field(ge=1, le=10_000)]


@pydantic_dataclass(frozen=True)
class Reproduce(Parameters):
    """How the main job is done."""

    seeds: Seeds = parameter(1)
    further_seeds: Seeds | None = parameter(None)
    """Over other horizons and presets than the scenario's own; None for as many as ``seeds``."""
    num_slots: OneOrMore[Count] | None = parameter(None, symbol="T")
    """Horizons to train and evaluate besides the scenario's own, as for Fig. 4."""
    also: OneOrMore[Preset] | None = parameter(None)
    """Presets that are flown too, with what was changed in the scenario, as for Fig. 3."""
    figures: OneOrMore[FigureName] | None = parameter(None)
    """To draw; None for all that these settings allow."""
    candidates: Annotated[int, Field(ge=1, le=1000)] = parameter(5)
    """Of each scheme's initial weights, where it is trained as in the paper."""
    candidate_episodes: Count = parameter(50)
    power_episodes: Count = parameter(400)
    """Of the training with the helper's power, at most."""
    seed: CountOrZero = parameter(0)
    reward: Text = parameter(SUM_RATE)
    """What a slot earns: a name, or FILE.py:NAME of a function or a transform."""
    device: Text = parameter("cpu")
    threads: Threads = parameter(1)


@recipe(
    "reproduce",
    Reproduce,
    groups={"scenario": "two_clusters", "algorithm": "ddpg_robust", "logger": "wandb"},
    sections={"training": TrainingParameters, "evaluation": EvaluationParameters},
    run_directory="runs/${now:%Y-%m-%d_%H-%M-%S}_reproduce_${hydra.runtime.choices.scenario}",
)
def main(config: Config, directory: Path) -> None:
    """Do the main job; the same directory again goes on where it was interrupted."""
    with telling_how_to_go_on(*same_call("hydra.run.dir", directory)):
        reproduce(config, directory)


def reproduce(config: Config, directory: Path) -> None:
    """Train the three learned schemes side by side, evaluate them all, draw the figures."""
    options = section(config, Reproduce)
    torch.set_num_threads(options.threads)
    work = Work(
        directory,
        EvaluationParameters.from_dict(config["evaluation"]),
        LoggerParameters.from_dict(config["logger"]),
        options.device,
        config,
        Console(),
    )
    own = RunConfiguration.from_dict({**config, "learners": _learners(options, options.seeds)})
    scenario, console = own.scenario, work.console
    others = _other_horizons(scenario, options)
    longest = max([scenario.num_slots, *others])
    usable_resolution(work.evaluation.resolution, scenario, longest, own.reward)
    further = _on_further_presets(own, options)

    run = work.train(directory, _over_horizons(own, options, others))
    as_in_paper = dataclasses.replace(own, algorithm_name="ddpg", algorithm=DDPG())
    weights = partial(_candidates, as_in_paper, options, console)
    paper_run = work.train(directory / AS_IN_PAPER, as_in_paper, weights)
    beside = learned_policies([paper_run], scenario, LEARNED_AS_IN_PAPER)
    runs = [run, paper_run]
    if (with_power := _with_power(own, options, console)) is not None:
        power_run = work.train(directory / WITH_POWER, with_power)
        beside |= learned_policies([power_run], with_power.scenario, LEARNED_WITH_POWER)
        runs.append(power_run)
    evaluated = [(run.path, work.evaluate(run, scenario, run.path, beside), runs)]
    for num_slots in others:
        over = dataclasses.replace(scenario, num_slots=num_slots)
        path = horizon_directory(run, num_slots)
        evaluated.append((path, work.evaluate(run, over, path), [run]))
    for configuration in further:
        trained = work.train(directory / configuration.scenario_name, configuration)
        evaluation = work.evaluate(trained, configuration.scenario, trained.path)
        evaluated.append((trained.path, evaluation, [trained]))
    draw(run, options.figures, console)
    paths = [run.path, *(run.path / own.scenario_name for own in further)]
    with make_progress(console, "reports") as progress:
        reports = [write_report(path) for path in progress.track(paths)]
    for path, evaluation, flown in evaluated:
        work.log(path, evaluation, flown)
    for path, evaluation, _ in evaluated:
        if path in paths:
            print_results(evaluation, console)
    print_line(f"figures: {run.figures}", console)
    for report in reports:
        print_line(f"report: {report}", console)


@dataclass(frozen=True)
class Work:
    """What all trainings and evaluations of the job share."""

    directory: Path
    evaluation: EvaluationParameters
    logger: LoggerParameters
    device: str
    request: Config
    console: Console

    def train(
        self,
        path: Path,
        configuration: RunConfiguration,
        initial_weights: Callable[[], dict[str, Tensor] | None] = lambda: None,
    ) -> RunDirectory:
        """Train, or go on with the training that was interrupted."""
        return train_or_resume(
            path,
            configuration,
            part_of(self.logger, self.directory, path),
            self.console,
            device=self.device,
            initial_weights=initial_weights,
            request=self.request,
        )

    def evaluate(
        self,
        run: RunDirectory,
        scenario: Scenario,
        directory: Path,
        beside: Policies | None = None,
    ) -> Evaluation:
        """Fly a run's actors, what stands beside them and the references; keep what came of it."""
        trained = run.configuration()
        reward = trained.reward
        learned = {**learned_policies([run], scenario), **(beside or {})}
        best = references(scenario, self.evaluation.resolution, self.console, reward)
        with make_progress(self.console, "evaluating") as progress:
            evaluation = evaluate(
                scenario,
                trained.scenario_name,
                {**learned, **best},
                self.evaluation,
                self.device,
                track=progress.track,
                reward=reward,
            )
        evaluation.save(directory)
        return evaluation

    def log(self, directory: Path, evaluation: Evaluation, trained: Sequence[RunDirectory]) -> None:
        """Log an evaluation in the group of the job's trainings, as a run of its own."""
        logger = part_of(self.logger, self.directory, directory)
        logger = dataclasses.replace(logger, id=None)
        log_evaluation(directory, evaluation, trained, logger, self.console)


def _other_horizons(scenario: Scenario, options: Reproduce) -> list[int]:
    """The horizons besides the scenario's own."""
    asked = dict.fromkeys(options.num_slots or ())
    others = [num_slots for num_slots in asked if num_slots != scenario.num_slots]
    if "horizons" in (options.figures or ()) and not others:
        accepted = f"horizons besides the scenario's {scenario.num_slots}, for the figure horizons"
        raise InputError(rejection("num_slots", options.num_slots, accepted))
    return others


def _learners(options: Reproduce, seeds: int | None) -> tuple[Learner, ...]:
    """So many of each scheme."""
    several = range(options.seed, options.seed + (seeds or options.seeds))
    return tuple(Learner(scheme, seed) for scheme in MODE_RULES for seed in several)


def _over_horizons(
    own: RunConfiguration, options: Reproduce, others: Sequence[int]
) -> RunConfiguration:
    """The same with learners over the other horizons too."""
    horizon = own.scenario.num_slots
    further = _learners(options, options.further_seeds)
    learners = [(horizon, learner) for learner in own.learners]
    learners += [(num_slots, learner) for num_slots in others for learner in further]
    return dataclasses.replace(
        own,
        learners=tuple(
            dataclasses.replace(learner, num_slots=num_slots) for num_slots, learner in learners
        ),
    )


def _on_further_presets(own: RunConfiguration, options: Reproduce) -> list[RunConfiguration]:
    """The same in other presets, changed as the scenario is."""
    presets = options.also or ()
    for index, name in enumerate(presets):
        if name in (own.scenario_name, *presets[:index]):
            accepted = "presets that differ from each other and from the scenario"
            raise InputError(rejection(f"also[{index}]", name, accepted))
    return [
        dataclasses.replace(
            own,
            scenario_name=name,
            scenario=_changed_alike(PRESETS[name], own),
            learners=_learners(options, options.further_seeds),
        )
        for name in presets
    ]


def _changed_alike(preset: Scenario, own: RunConfiguration) -> Scenario:
    """A preset with what differs in the run's scenario, but for the UEs, from its own preset."""
    flown = own.scenario
    begun = PRESETS.get(own.scenario_name, Scenario(ue_positions=flown.ue_positions)).to_dict()
    changes = {name: value for name, value in flown.to_dict().items() if value != begun[name]}
    return dataclasses.replace(preset, **{**changes, "ue_positions": preset.ue_positions})


def _with_power(
    own: RunConfiguration, options: Reproduce, console: Console
) -> RunConfiguration | None:
    """The same for the hybrid learners with the helper's power; None where that cannot be."""
    if own.scenario.power_control:
        return None
    with_power = dataclasses.replace(
        own,
        scenario=SCHEMES[PROPOSED_POWER].flown_in(own.scenario),
        learners=tuple(learner for learner in own.learners if learner.scheme == "hybrid"),
    ).with_episodes(min(own.training.num_episodes, options.power_episodes))
    try:
        with_power.new_training()
    except InputError as error:
        print_line(f"{LABELS[PROPOSED_POWER]} is left out: {error}", console)
        return None
    return with_power


def _candidates(
    configuration: RunConfiguration, options: Reproduce, console: Console
) -> dict[str, Tensor] | None:
    """The weights to begin with as the paper does; None for fresh ones."""
    if options.candidates == 1:
        return None
    episodes = options.candidate_episodes
    with make_progress(console, "initial weights") as progress:
        track = partial(progress.track, total=episodes)
        weights, earned = select_initial_weights(
            configuration, options.candidates, episodes, device=options.device, track=track
        )
    reached = ", ".join(f"{value:.1f}" for value in earned)
    console.print(
        f"as in the paper, initial weights from {options.candidates} candidates per scheme "
        f"after {episodes} episodes: {reached} {configuration.reward.unit}"
    )
    return weights


if __name__ == "__main__":
    main()
