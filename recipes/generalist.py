"""Train one policy for every layout.

hyuav generalist output=runs/generalist
hyuav generalist scenarios=600 learning.steps=2000
hyuav generalist learning.way=reinforcement
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

import pandas as pd
import torch
from rich.console import Console

from hyuav._support.formatting import percent
from hyuav._support.terminal import print_line
from hyuav.experiments.command_line import same_call
from hyuav.experiments.configuration import Config, recipe, section, telling_how_to_go_on
from hyuav.experiments.generalist import (
    PROGRESS_FILE,
    WEIGHTS_FILE,
    GeneralistDirectory,
    TrainGeneralist,
)
from hyuav.learning.generalist.training import GeneralistParameters
from hyuav.viz.paper.progress import progress_figure
from hyuav.viz.paper.style import save_figure


@recipe(
    "generalist",
    TrainGeneralist,
    groups={},
    sections={"learning": GeneralistParameters},
    run_directory="${output}",
)
def main(config: Config, directory: Path) -> None:
    """Do what is left of the training; told to stop, say how to go on."""
    options, console = section(config, TrainGeneralist), Console()
    torch.set_num_threads(options.threads)
    parameters = GeneralistParameters.from_dict(config["learning"])
    with telling_how_to_go_on(*same_call("output", directory)):
        training = GeneralistDirectory(directory, config, options, parameters)
        last = training.learn(console)
    print_line(
        f"of the optimum in scenarios for validation: {percent(last.mean, 2)} in the mean, "
        f"{percent(last.fifth_percentile, 2)} at the 5th percentile, {percent(last.worst)} worst",
        console,
    )
    progress = pd.read_csv(directory / PROGRESS_FILE)
    save_figure(progress_figure({parameters.way: progress}), directory, "progress")
    told = f"{PROGRESS_FILE}, drawn in progress.png"
    print_line(f"weights: {directory / WEIGHTS_FILE}, progress: {told}", console)


if __name__ == "__main__":
    main()
