"""Write the report of a run, a comparison or a map, one HTML file.

hyuav report run=runs/NAME
hyuav report run=[runs/ONE,runs/OTHER]
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

import torch
from pydantic.dataclasses import dataclass
from rich.console import Console

from hyuav._support.errors import InputError
from hyuav._support.parameters import OneOrMore, Parameters, Text, Threads, ZeroOrMore, parameter
from hyuav._support.terminal import print_line
from hyuav.experiments.configuration import Config, recipe, section
from hyuav.experiments.own_code import OwnAlgorithm, OwnReward
from hyuav.viz.html.page import write_report


@dataclass(frozen=True)
class Report(Parameters):
    """What to report on."""

    run: OneOrMore[Text] | None = parameter(None)
    """Directories of runs, comparisons or maps of regimes, finished or not."""
    algorithm: ZeroOrMore[OwnAlgorithm] = parameter(())
    """The runs' own algorithms; a run's directory names a file, but only you let it be run."""
    reward: ZeroOrMore[OwnReward] = parameter(())
    """Their own rewards, for the same reason."""
    threads: Threads = parameter(1)


@recipe("report", Report, groups={}, sections={}, run_directory=".")
def main(config: Config, _: Path) -> None:
    """Write the reports, and say where they are."""
    options = section(config, Report)
    if options.run is None:
        raise InputError("run is missing: expected run=DIRECTORY, or run=[DIRECTORY,...]")
    torch.set_num_threads(options.threads)
    console = Console()
    for directory in options.run:
        print_line(f"report: {write_report(directory)}", console)


if __name__ == "__main__":
    main()
