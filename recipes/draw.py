"""Draw the figures of a finished run again, from its files alone.

hyuav draw run=runs/NAME
hyuav draw run=runs/NAME figures=[trajectories,animation]
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

import torch
from pydantic.dataclasses import dataclass
from rich.console import Console

from hyuav._support.errors import InputError
from hyuav._support.files import require_writable
from hyuav._support.parameters import OneOrMore, Parameters, Text, ZeroOrMore, parameter
from hyuav._support.terminal import print_line
from hyuav.experiments.configuration import Config, recipe, section
from hyuav.experiments.own_code import OwnAlgorithm, OwnReward
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.paper.gallery import FigureName, draw


@dataclass(frozen=True)
class Draw(Parameters):
    """Which figures of which run."""

    run: Text | None = parameter(None)
    algorithm: ZeroOrMore[OwnAlgorithm] = parameter(())
    """The runs' own algorithms; a run's directory names a file, but only you let it be run."""
    reward: ZeroOrMore[OwnReward] = parameter(())
    """Their own rewards, for the same reason."""
    figures: OneOrMore[FigureName] | None = parameter(None)
    """None for all that the run's files allow."""


@recipe("draw", Draw, groups={}, sections={}, run_directory=".")
def main(config: Config, _: Path) -> None:
    """Draw, and say where the figures are."""
    options = section(config, Draw)
    if options.run is None:
        raise InputError("run is missing: expected run=DIRECTORY")
    torch.set_num_threads(1)
    run = RunDirectory(options.run)
    run.configuration()  # before a directory for figures is made where there is no run
    require_writable("run", run.figures)
    console = Console()
    draw(run, options.figures, console)
    print_line(f"figures: {run.figures}", console)


if __name__ == "__main__":
    main()
