"""Every figure that the files of a finished run allow, drawn from them alone."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
from rich.console import Console

from hyuav._support.errors import InputError
from hyuav._support.parameters import OneOf
from hyuav._support.terminal import make_progress, print_line
from hyuav.experiments.comparison.tables import label
from hyuav.experiments.evaluation import EVALUATION_FILE, FLIGHTS_FILE, LABELS, OPTIMA
from hyuav.experiments.experiment import LEARNED
from hyuav.experiments.run_directory import RunDirectory, readable_metrics
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.reading import is_drawable, readable_evaluation, readable_flights
from hyuav.viz.paper.animation import animate_flight
from hyuav.viz.paper.curves import learning_curves, learning_table
from hyuav.viz.paper.flights import (
    FLOWN_BY_LEARNING,
    first_flight,
    flight_tables,
    save_flight_map,
    trajectories,
)
from hyuav.viz.paper.horizons import horizon_table, sum_rates_by_horizon
from hyuav.viz.paper.maps import sum_rate_maps, sum_rate_table
from hyuav.viz.paper.over_time import (
    energy_by_slot,
    energy_table,
    offloading_by_slot,
    offloading_table,
)
from hyuav.viz.paper.style import COMPARED, save_figure, save_tables

AS_IN_PAPER, HORIZONS = "as_in_paper", "horizons"
"""Directories within a main job's run: the paper's own algorithm, and other horizons."""


def horizon_directory(run: RunDirectory, num_slots: int) -> Path:
    """Where the evaluation over another horizon than the scenario's own is kept."""
    return run.path / HORIZONS / f"T{num_slots}"


class Finished:
    """What the files of a finished run tell.

    Args:
        run: the directory of a training, of an evaluation of it, or of the main job.
    """

    def __init__(self, run: RunDirectory) -> None:
        self.run = run
        self.scenario: Scenario = run.configuration().scenario

    @cached_property
    def flights(self) -> pd.DataFrame:
        """A few flights of each scheme, a row per slot.

        Raises:
            InputError: no scheme was evaluated, the file is damaged, or another scenario's.
        """
        file = self._existing(FLIGHTS_FILE)
        flights = readable_flights(self.run.path)
        if flights is None:
            raise InputError(
                f"{file}: expected flights in Parquet (recipes/evaluate.py makes them)"
            )
        if not is_drawable(flights, self.scenario.num_ues):
            raise InputError(f"{file}: expected flights over {self.scenario.num_ues} UEs")
        return flights

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The evaluation over the scenario's own horizon, or whichever was asked for last.

        Raises:
            InputError: there is none, or the file is damaged.
        """
        return _read(self._existing(EVALUATION_FILE))

    @property
    def flown(self) -> Scenario:
        """The scenario with the horizon that was evaluated."""
        return dataclasses.replace(self.scenario, num_slots=self.summary["num_slots"])

    def summaries(self) -> list[dict[str, Any]]:
        """The evaluations over all horizons.

        Raises:
            InputError: there are fewer than two.
        """
        others = (self.run.path / HORIZONS).glob(f"T*/{EVALUATION_FILE}")
        read = [*(_read(file) for file in others), self.summary]
        by_horizon = {summary["num_slots"]: summary for summary in read}
        if len(by_horizon) < 2:
            raise InputError("it takes evaluations over two horizons or more (num_slots=[10,20])")
        return list(by_horizon.values())

    def trainings(self) -> dict[str, RunDirectory]:
        """The trainings on the scenario, by what they are called."""
        trainings = {label(self.run.configuration().algorithm_name): self.run}
        paper = RunDirectory(self.run.path / AS_IN_PAPER)
        if paper.config_file.exists():
            trainings[f"{label(paper.configuration().algorithm_name)}, as in the paper"] = paper
        return trainings

    def optima(self) -> dict[str, float]:
        """By learned scheme, what its best flight earns over the scenario's horizon: bps/Hz.

        Empty where that was not evaluated.
        """
        if not (self.run.path / EVALUATION_FILE).exists():
            return {}
        if self.summary["num_slots"] != self.scenario.num_slots:
            return {}
        results = self.summary["schemes"]
        return {
            scheme: results[OPTIMA[rule]]["secrecy_sum_rate"]["mean"]
            for rule, scheme in LEARNED.items()
            if OPTIMA[rule] in results
        }

    def _existing(self, name: str) -> Path:
        file = self.run.path / name
        if not file.exists():
            raise InputError(
                f"there is no {name} in {self.run.path} (recipes/evaluate.py makes it)"
            )
        return file


def _read(file: Path) -> dict[str, Any]:
    content = readable_evaluation(file.parent)
    if content is None:
        raise InputError(f"{file}: expected an evaluation in JSON (recipes/evaluate.py makes it)")
    return content


def _learning_curves(finished: Finished, directory: Path, name: str) -> None:
    tables = []
    for training, run in finished.trainings().items():
        if not run.metrics_file.exists():
            raise InputError(f"there is no {run.metrics_file.name} in {run.path}")
        metrics = readable_metrics(run.metrics_file)
        if metrics.empty:
            metrics = run.metrics()  # which refuses what is no table
        own = metrics[metrics["num_slots"] == finished.scenario.num_slots]
        rewards = {
            LEARNED[str(rule)]: rows.pivot_table("accumulated_reward", "episode", "learner")
            for rule, rows in own.groupby("scheme")
            if rule in LEARNED
        }
        if rewards:
            tables.append(learning_table(rewards, finished.optima(), training))
    if not tables:
        raise InputError(f"no learner has the scenario's T = {finished.scenario.num_slots}")
    table = pd.concat(tables, ignore_index=True)
    save_figure(learning_curves(table), directory, name, {"": table})


def _trajectories(finished: Finished, directory: Path, name: str) -> None:
    scenario, flights = finished.flown, finished.flights
    tables = flight_tables(scenario, flights, [*FLOWN_BY_LEARNING, "optimum"])
    save_figure(trajectories(scenario, flights), directory, name, tables)


def _horizons(finished: Finished, directory: Path, name: str) -> None:
    table = horizon_table(finished.summaries())
    save_figure(sum_rates_by_horizon(table), directory, name, {"": table})


def _flight_map(finished: Finished, directory: Path, name: str) -> None:
    save_flight_map(finished.flown, finished.flights, directory, name)


def _sum_rate_maps(finished: Finished, directory: Path, name: str) -> None:
    table = sum_rate_table(finished.scenario)
    save_figure(sum_rate_maps(finished.scenario, table), directory, name, {"": table})


def _energy(finished: Finished, directory: Path, name: str) -> None:
    table = energy_table(finished.flown, finished.flights)
    save_figure(energy_by_slot(table), directory, name, {"": table})


def _offloading(finished: Finished, directory: Path, name: str) -> None:
    table = offloading_table(finished.flights)
    save_figure(offloading_by_slot(table), directory, name, {"": table})


def _animation(finished: Finished, directory: Path, name: str) -> None:
    shown = next(name for name in (*COMPARED, *LABELS) if name in set(finished.flights["scheme"]))
    slots = first_flight(finished.flights, shown)
    animate_flight(finished.flown, slots, directory / f"{name}.gif")
    save_tables(directory, name, {"": slots})


FIGURES: dict[str, Callable[[Finished, Path, str], None]] = {
    "learning_curves": _learning_curves,
    "trajectories": _trajectories,
    "horizons": _horizons,
    "flight_map": _flight_map,
    "sum_rate_maps": _sum_rate_maps,
    "energy": _energy,
    "offloading": _offloading,
    "animation": _animation,
}
"""What draws each figure into a directory under a name; the first three are the paper's."""

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
    further = [RunDirectory(path) for path in within if path.name != AS_IN_PAPER]
    several = [(each, Finished(each)) for each in (run, *further)]
    drawings = [(*own, name) for own in several for name in names or FIGURES]
    with make_progress(console, "figures") as progress:
        for each, finished, name in progress.track(drawings):
            try:
                FIGURES[name](finished, each.figures, name)
            except InputError as error:
                if names is not None and each is run:
                    raise InputError(f"figure {name}: {error}") from None
                print_line(f"{each.path.name}: figure {name} is left out: {error}", console)
