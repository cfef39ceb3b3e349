"""Solving what is left of a map of regimes, line by line."""

import dataclasses
import sys
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd
from rich.console import Console

from hyuav._support.errors import InputError, ScenarioWarning
from hyuav._support.files import read_parquet, write_durably
from hyuav._support.terminal import make_progress
from hyuav.envs.rewards import DEFAULT
from hyuav.experiments import schemes
from hyuav.experiments.comparison.processes import Workers
from hyuav.experiments.configuration import Config
from hyuav.experiments.regimes.plan import Axes, MapPoint, Regimes
from hyuav.experiments.requests import keep_request
from hyuav.physics.scenario import Scenario
from hyuav.references.optimum import solve_optimum

SCHEMES = ("no_helper", "relay", "jamming", "hybrid", "power_control")
"""What is solved at each point. The last is the hybrid helper whose power is chosen too."""

REGIMES_FILE, LINES = "regimes.csv", "lines"

WORKING = ("workers", "retries", "output")
"""Entries of the configuration that change how the work is done and not what comes of it."""


def solve_point(scenario: Scenario, options: Regimes) -> dict[str, float]:
    """What the best flight of each of :data:`SCHEMES` brings over the T slots, in bps/Hz.

    Without a helper, UEs within their budgets send straight to L. Flights are chosen and flown in
    the same fading for all of them.

    Args:
        scenario: of one helper; whether its power is controlled does not matter.
        options: how exactly it is solved.
    """
    fixed = dataclasses.replace(scenario, power_control=False)
    controlled = dataclasses.replace(scenario, power_control=True)
    solve = partial(
        solve_optimum,
        power_step=options.power_step,
        draws=options.draws,
        evaluation_draws=options.evaluation_draws,
        seed=options.seed,
        reward=DEFAULT,
    )
    silent = schemes.SCHEMES[schemes.NO_HELPER].flown_in(fixed)  # wherever the helper is
    with warnings.catch_warnings():  # that nothing is earned somewhere is what the map shows
        warnings.simplefilter("ignore", ScenarioWarning)
        alone = solve(silent, ["jamming"], resolution=scenario.map_side)["jamming"]
        optima = solve(fixed, ["relay", "jamming", "hybrid"], resolution=options.resolution)
        best = solve(controlled, ["hybrid"], resolution=options.resolution)["hybrid"]
    found = [alone, *optima.values(), best]
    return {name: own.value for name, own in zip(SCHEMES, found, strict=True)}


@dataclass(frozen=True)
class MapLine:
    """The points of one value of y, solved once and kept in a file."""

    axes: Axes
    points: list[MapPoint]
    options: Regimes
    file: Path
    """In Parquet, of which :meth:`table` tells the columns."""

    @property
    def is_solved(self) -> bool:
        """Whether the file holds the line whole."""
        try:
            return len(self.table().dropna()) == len(self.points)
        except InputError:
            return False

    def solve(self) -> None:
        """Solve each point and write the file."""
        x, y = self.axes.x.field, self.axes.y.field
        rows = [
            {x: point.x, y: point.y, **solve_point(point.scenario, self.options)}
            for point in self.points
        ]
        write_durably(self.file, pd.DataFrame(rows).to_parquet())

    def table(self) -> pd.DataFrame:
        """A row for each point: both parameters, and the sum-rate of each scheme in bps/Hz.

        Raises:
            InputError: the file is missing or damaged.
        """
        columns = [self.axes.x.field, self.axes.y.field, *SCHEMES]
        return read_parquet(self.file, "a line of a map of regimes", columns)


class RegimeDirectory:
    """The files of one map: ``config.yaml``, ``lines/`` and, of all lines, ``regimes.csv``.

    Args:
        path: of the directory, which may hold part of the same map.
        config: all that was asked for.
        axes: what is swept.
        scenario: that has all other parameters.
        options: how exactly each point is solved.

    Raises:
        InputError: a value that the scenario does not accept, another map in the directory, or a
            place that cannot be written to.
        OSError: what was asked for cannot be kept, for want of space perhaps.
    """

    def __init__(
        self, path: Path, config: Config, axes: Axes, scenario: Scenario, options: Regimes
    ) -> None:
        lines = axes.lines(scenario)
        for line in lines:
            for point in line:
                options.require_usable(point.scenario)
        keep_request(path, config, WORKING, "a map")
        self.path, self.options = path, options
        self.lines = [
            MapLine(axes, points, options, path / LINES / f"{number:04}.parquet")
            for number, points in enumerate(lines)
        ]

    def complete(self, console: Console) -> dict[str, str]:
        """Solve the lines that are missing or damaged, and write ``regimes.csv``.

        Args:
            console: on which a terminal shows the progress.

        Returns:
            the reason for each failure, by what failed.
        """
        failures = {}
        left = [line for line in self.lines if not line.is_solved]
        for line in left:
            if line.file.exists():
                print(f"{line.file}: damaged or incomplete, and made anew", file=sys.stderr)
        progress = make_progress(console, "lines of the map")
        with progress, Workers(self.options.workers, self.options.retries) as workers:
            done = len(self.lines) - len(left)
            task = progress.add_task("lines", total=len(self.lines), completed=done)
            for line, reason in workers.attempt_all(MapLine.solve, left):
                progress.advance(task)
                if reason is not None:
                    failures[f"line {line.file.stem}"] = reason
        if not failures:
            text = pd.concat([line.table() for line in self.lines]).to_csv(index=False)
            write_durably(self.path / REGIMES_FILE, text.encode())
        return failures
