"""Every figure that the files of a finished run allow, drawn from them alone."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console

from hyuav._support.errors import InputError
from hyuav._support.parameters import OneOf
from hyuav._support.terminal import make_progress, print_line
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import LABELS
from hyuav.viz.data.flights import (
    energy_table,
    flight_tables,
    offloading_table,
    read_flight,
)
from hyuav.viz.data.maps import helper_map
from hyuav.viz.data.runs import AS_IN_PAPER, WITH_POWER, FinishedRun
from hyuav.viz.data.schemes import COMPARED
from hyuav.viz.paper.animation import animate_flight
from hyuav.viz.paper.curves import learning_figure
from hyuav.viz.paper.flights import TRAJECTORIES, save_flight_map, trajectories
from hyuav.viz.paper.horizons import sum_rates_by_horizon
from hyuav.viz.paper.maps import sum_rate_maps
from hyuav.viz.paper.over_time import energy_by_slot, offloading_by_slot
from hyuav.viz.paper.style import save_figure, save_tables

Drawing = Callable[[FinishedRun, Path, str], None]
"""Draws a figure of a run into a directory, under a name."""


def _of(table: Callable[[FinishedRun], pd.DataFrame], figure: Callable[..., Figure]) -> Drawing:
    """A figure that shows one table."""

    def draw_table(finished: FinishedRun, directory: Path, name: str) -> None:
        shown = table(finished)
        save_figure(figure(shown), directory, name, {"": shown})

    return draw_table


def _trajectories(finished: FinishedRun, directory: Path, name: str) -> None:
    scenario, flights = finished.flown, finished.flights
    tables = flight_tables(scenario, flights, TRAJECTORIES)
    save_figure(trajectories(scenario, flights), directory, name, tables)


def _flight_map(finished: FinishedRun, directory: Path, name: str) -> None:
    save_flight_map(finished.flown, finished.flights, directory, name)


def _sum_rate_maps(finished: FinishedRun, directory: Path, name: str) -> None:
    table = helper_map(finished.scenario).table()
    save_figure(sum_rate_maps(finished.scenario, table), directory, name, {"": table})


def _animation(finished: FinishedRun, directory: Path, name: str) -> None:
    shown = next(name for name in (*COMPARED, *LABELS) if name in set(finished.flights["scheme"]))
    flight = read_flight(finished.flown, finished.flights, shown)
    animate_flight(finished.flown, flight, directory / f"{name}.gif")
    save_tables(directory, name, {"": flight.rows})


FIGURES: dict[str, Drawing] = {
    "learning_curves": _of(FinishedRun.learning, learning_figure),
    "trajectories": _trajectories,
    "horizons": _of(FinishedRun.horizons, sum_rates_by_horizon),
    "flight_map": _flight_map,
    "sum_rate_maps": _sum_rate_maps,
    "energy": _of(lambda finished: energy_table(finished.flown, finished.flights), energy_by_slot),
    "offloading": _of(
        lambda finished: offloading_table(finished.flown, finished.flights), offloading_by_slot
    ),
    "animation": _animation,
}
"""By their names; the first three are the paper's."""

FigureName = Annotated[str, OneOf(*FIGURES)]


def draw(run: RunDirectory, names: Sequence[str] | None, console: Console) -> None:
    """Draw figures of a run, and of the runs within it, from their files.

    Args:
        run: the directory.
        names: of :data:`FIGURES`; None for all that the files allow. The console says which were
            left out and why.
        console: for that.

    Raises:
        InputError: there is no run, or a file that a named figure needs is missing.
    """
    within = sorted(file.parent for file in run.path.glob("*/config.yaml"))
    further = [RunDirectory(path) for path in within if path.name not in (AS_IN_PAPER, WITH_POWER)]
    several = [(each, FinishedRun(each)) for each in (run, *further)]
    drawings = [(*own, name) for own in several for name in names or FIGURES]
    with make_progress(console, "figures") as progress:
        for each, finished, name in progress.track(drawings):
            try:
                FIGURES[name](finished, each.figures, name)
            except InputError as error:
                if names is not None and each is run:
                    raise InputError(f"figure {name}: {error}") from None
                print_line(f"{each.path.name}: figure {name} is left out: {error}", console)
