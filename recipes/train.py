"""Train learners and keep the run.

hyuav train scenario=two_clusters scheme=hybrid algorithm=ddpg seed=0
hyuav train scheme=[hybrid,relay,jamming] num_slots=[10,20] learners=10
hyuav train scenario=disk scenario.num_ues=12 scenario.seed=3
hyuav train resume=runs/NAME
hyuav train resume=runs/NAME training.num_episodes=2000
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path
from typing import Annotated

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass
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
    mapping,
    parameter,
)
from hyuav._support.registry import is_reference
from hyuav._support.terminal import print_line
from hyuav.envs.rewards import SUM_RATE
from hyuav.experiments.cloning import cloned_weights
from hyuav.experiments.configuration import (
    Config,
    given,
    recipe,
    remove_if_empty,
    section,
    telling_how_to_go_on,
)
from hyuav.experiments.initial_weights import saved_weights
from hyuav.experiments.quoting import override
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import resume, train_or_resume
from hyuav.learning.generalist.pretrained import PRETRAINED
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.physics.modes import ModeRuleName
from hyuav.viz.html.page import write_report

EPISODES = "training.num_episodes"
"""What of a training may be changed when it goes on."""


@dataclass(frozen=True)
class Train(Parameters):
    """What to train, besides the scenario, the algorithm and its training."""

    scheme: OneOrMore[ModeRuleName] = parameter(("hybrid",))
    num_slots: OneOrMore[Count] | None = parameter(None)
    learners: Annotated[int, Field(ge=1, le=100_000)] = parameter(1)
    """Of each scheme and horizon; their seeds follow ``seed``."""
    seed: CountOrZero = parameter(0)
    reward: Text = parameter(SUM_RATE)
    """What a slot earns: a name, or FILE.py:NAME of a function or a transform."""
    device: Text = parameter("cpu")
    threads: Threads = parameter(1)
    warm_start: Text | None = parameter(None)
    """A run or a checkpoint with whose weights to begin; generalist for actors that imitate it."""
    resume: Text | None = parameter(None)
    """Directory of a training with which to go on as it was configured, or for more episodes."""


@recipe(
    "train",
    Train,
    groups={"scenario": "two_clusters", "algorithm": "ddpg", "logger": "wandb"},
    sections={"training": TrainingParameters},
    run_directory="runs/${now:%Y-%m-%d_%H-%M-%S}_${hydra.runtime.choices.scenario}"
    "_${hydra.runtime.choices.algorithm}_${seed}",
)
def main(config: Config, directory: Path) -> None:
    """Train, and say where the run is; the same call for the same directory goes on with it."""
    options = section(config, Train)
    if options.resume is not None:
        remove_if_empty(directory)  # which Hydra made for a new training
        go_on(options.resume, config)
        return
    torch.set_num_threads(options.threads)
    logger, console = LoggerParameters.from_dict(config["logger"]), Console()
    learners = [
        Learner(scheme, options.seed + index, num_slots)
        for scheme in options.scheme
        for num_slots in options.num_slots or (None,)
        for index in range(options.learners)
    ]
    configuration = RunConfiguration.from_dict({**config, "learners": learners})
    start = options.warm_start
    begun = RunDirectory(directory)
    with telling_how_to_go_on(override("resume", directory), possible=lambda: begun.exists):
        run = train_or_resume(
            directory,
            configuration,
            logger,
            console,
            device=options.device,
            request=config,
            initial_weights=lambda: beginning(start, configuration),
        )
    tell(run, console)


def beginning(start: str | None, configuration: RunConfiguration) -> dict[str, Tensor] | None:
    """The weights with which a training begins, where these are not fresh."""
    if start is None:
        return None
    if start in PRETRAINED and not Path(start).exists():
        return cloned_weights(configuration)
    return saved_weights(start)


def go_on(path: str, config: Config) -> None:
    """Go on with a training as it was configured, or for more episodes.

    The place to compute and the logger may change.

    Raises:
        InputError: there is none, or something was asked for that would change what is trained.
    """
    own = {"algorithm": config["algorithm"]["name"], "reward": config["reward"]}
    named = {field for field, name in own.items() if is_reference(name)}
    for name in given() - {"resume", "device", "threads", EPISODES} - named:
        if name == "hydra.run.dir" or not name.startswith(("logger", "hydra.")):
            accepted = f"nothing beside it but device=, threads=, logger.NAME= and {EPISODES}="
            hint = f"{override('warm_start', Path(path))} begins a new training with its weights"
            raise InputError(f"{rejection('resume', path, accepted)}, not {name} ({hint})")
    asked = RunDirectory(path).request()
    kept = {"device", "threads", "logger"} & asked.keys() - given()
    begun = {**config, **{name: asked[name] for name in kept}}
    options = section({**begun, "resume": path}, Train)
    changed = {name: own for name, own in config["logger"].items() if f"logger.{name}" in given()}
    logger = LoggerParameters.from_dict({**mapping("logger", begun["logger"]), **changed})
    torch.set_num_threads(options.threads)
    console = Console()
    episodes = config["training"]["num_episodes"] if EPISODES in given() else None
    longer = [] if episodes is None else [f"{EPISODES}={episodes}"]
    with telling_how_to_go_on(override("resume", Path(path)), *longer):
        run = resume(path, logger, console, device=options.device, num_episodes=episodes)
    tell(run, console)


def tell(run: RunDirectory, console: Console) -> None:
    """Print what a run's learners have reached, and where it is."""
    best = run.metrics().groupby("learner")["best_evaluation"].last()
    returns = ", ".join(f"{value:.2f}" for value in best)
    unit = run.configuration().reward.in_brackets
    print_line(f"best noise-free accumulated reward{unit}: {returns}", console)
    print_line(f"run: {run.path}", console)
    print_line(f"its report: {write_report(run.path).name}", console)


if __name__ == "__main__":
    main()
