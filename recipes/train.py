"""Train learners and keep the run.

python recipes/train.py scenario=two_clusters scheme=hybrid algorithm=ddpg seed=0
python recipes/train.py scheme=[hybrid,relay,jamming] num_slots=[10,20] learners=10
python recipes/train.py resume=runs/NAME
"""

import hyuav_start  # noqa: F401 - first: the rest takes seconds to load

from dataclasses import dataclass
from pathlib import Path

import torch
from rich.console import Console

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import (
    Parameters,
    choice,
    count,
    mapping,
    one_or_more,
    optional,
    parameter,
    text,
    thread_count,
)
from hyuav._support.terminal import print_line
from hyuav.experiments.configuration import (
    Config,
    given,
    override,
    recipe,
    remove_if_empty,
    section,
    telling_how_to_go_on,
)
from hyuav.experiments.experiment import resume, saved_weights, train_or_resume
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.learning.train import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.physics.slot import SCHEMES
from hyuav.viz.html.page import write_run_report


@dataclass(frozen=True)
class Train(Parameters):
    """What to train, besides the scenario, the algorithm and its training."""

    scheme: tuple[str, ...] = parameter(one_or_more(choice(*SCHEMES), "schemes"), ("hybrid",))
    num_slots: tuple[int, ...] | None = parameter(
        optional(one_or_more(count(), "numbers of slots")), None
    )
    learners: int = parameter(count(1, 100_000), 1)
    """Of each scheme and horizon; their seeds follow ``seed``."""
    seed: int = parameter(count(0), 0)
    device: str = parameter(text, "cpu")
    threads: int = parameter(thread_count, 1)
    warm_start: str | None = parameter(optional(text), None)
    resume: str | None = parameter(optional(text), None)
    """Directory of an interrupted training, with which to go on as it was configured."""


@recipe(
    "train",
    Train,
    groups={"scenario": "two_clusters", "algorithm": "ddpg"},
    sections={"training": TrainingParameters, "logger": LoggerParameters},
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
            initial_weights=lambda: None if start is None else saved_weights(start),
        )
    tell(run, console)


def go_on(path: str, config: Config) -> None:
    """Go on with a training as it was configured; the place to compute and to log may change.

    Raises:
        InputError: there is none, or something else was asked for beside it.
    """
    for name in given() - {"resume", "device", "threads"}:
        if name == "hydra.run.dir" or not name.startswith(("logger.", "hydra.")):
            accepted = "nothing beside it but device=, threads= and logger.NAME="
            raise InputError(f"{rejection('resume', path, accepted)}, not {name}")
    asked = RunDirectory(path).request()
    kept = {"device", "threads", "logger"} & asked.keys() - given()
    begun = {**config, **{name: asked[name] for name in kept}}
    options = section({**begun, "resume": path}, Train)
    own = {name: value for name, value in config["logger"].items() if f"logger.{name}" in given()}
    logger = LoggerParameters.from_dict({**mapping("logger", begun["logger"]), **own})
    torch.set_num_threads(options.threads)
    console = Console()
    with telling_how_to_go_on(override("resume", Path(path))):
        run = resume(path, logger, console, device=options.device)
    tell(run, console)


def tell(run: RunDirectory, console: Console) -> None:
    """Print what a run's learners have reached, and where it is."""
    best = run.metrics().groupby("learner")["best_evaluation"].last()
    returns = ", ".join(f"{value:.2f}" for value in best)
    print_line(f"best noise-free accumulated reward (bps/Hz): {returns}", console)
    print_line(f"run: {run.path}", console)
    print_line(f"its report: {write_run_report(run.path).name}", console)


if __name__ == "__main__":
    main()
