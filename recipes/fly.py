"""Fly the generalist, which comes trained, in any scenario.

hyuav fly scenario=two_clusters
hyuav fly scenario=disk scenario.num_ues=15 scenario.seed=4 refine=true
hyuav fly scenario.legitimate_position=[20,-10] scenario.num_slots=30
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

import torch
from pydantic.dataclasses import dataclass
from rich.console import Console

from hyuav._support.parameters import (
    Count,
    CountOrZero,
    Parameters,
    PositiveNumber,
    Threads,
    parameter,
)
from hyuav._support.terminal import print_line
from hyuav.experiments.configuration import Config, recipe, section
from hyuav.experiments.evaluation_table import print_results
from hyuav.experiments.fly import fly, usable_resolution
from hyuav.experiments.scenarios import named_scenario
from hyuav.viz.paper.flights import save_flight_map


@dataclass(frozen=True)
class Fly(Parameters):
    """How to fly, and how exactly the optimum beside it is solved."""

    episodes: Count = parameter(100)
    seed: CountOrZero = parameter(0)
    refine: bool = parameter(False)
    """Improve the flights by a local search with the exact model."""
    resolution: PositiveNumber | None = parameter(None, unit="m")
    """Of the optimum's grid; None for 4 m, or 10 m with several helpers. Finer ones take longer."""
    threads: Threads = parameter(1)


@recipe(
    "fly",
    Fly,
    groups={"scenario": "two_clusters"},
    sections={},
    run_directory="runs/${now:%Y-%m-%d_%H-%M-%S}_${hydra.runtime.choices.scenario}_fly",
)
def main(config: Config, directory: Path) -> None:
    """Fly, print the table, draw the flights."""
    options, console = section(config, Fly), Console()
    torch.set_num_threads(options.threads)
    name, scenario = named_scenario(config["scenario"])
    evaluation = fly(
        scenario,
        episodes=options.episodes,
        seed=options.seed,
        refine=options.refine,
        resolution=options.resolution,
        output=directory,
        name=name,
    )
    save_flight_map(scenario, evaluation.flights, directory / "figures")
    print_results(evaluation, console)
    spacing = usable_resolution(scenario, options.resolution)
    print_line(f"the optimum is of a grid of {spacing:g} m; finer: resolution=1", console)
    print_line(f"evaluation: {directory}, its map: figures/flight_map.png", console)


if __name__ == "__main__":
    main()
