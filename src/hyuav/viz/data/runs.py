"""What the directory of a run tells: its evaluations, trainings and flights."""

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from hyuav._support.errors import InputError
from hyuav.experiments.comparison.tables import label
from hyuav.experiments.elsewhere import HORIZONS
from hyuav.experiments.evaluation import EVALUATION_FILE, FLIGHTS_FILE, Evaluation
from hyuav.experiments.evaluation_table import earned, earned_title
from hyuav.experiments.metrics import readable_metrics
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.scenarios import named_scenario
from hyuav.experiments.schemes import LEARNED, LEARNED_AS_IN_PAPER, NO_HELPER
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.curves import learning_curves, learning_table
from hyuav.viz.data.reading import (
    is_drawable,
    read_evaluation,
    read_flights,
    readable_evaluation,
    readable_flights,
    references_of,
)
from hyuav.viz.data.schemes import BEST, DRAWN

AS_IN_PAPER = "as_in_paper"
"""Directory of the paper's own algorithm within a main job's run."""

WITH_POWER = "with_power"
"""The same of the training with the helper's power."""


def evaluation_directories(directory: Path) -> list[Path]:
    """Where evaluations of a run may be, the one over the scenario's own horizon first."""
    return [directory, *sorted(directory.glob(f"{HORIZONS}/T*"))]


class FinishedRun:
    """What the files of a finished run tell.

    Args:
        run: the directory of a training, of an evaluation of it, or of the main job.
    """

    def __init__(self, run: RunDirectory) -> None:
        self.run = run
        configuration = run.configuration()
        self.scenario: Scenario = configuration.trained_scenario
        self._unit = configuration.reward.unit

    @cached_property
    def flights(self) -> pd.DataFrame:
        """A few flights of each scheme, a row per slot.

        Raises:
            InputError: no scheme was evaluated, the file is damaged, or another scenario's.
        """
        flights = read_flights(self.run.path)
        if not is_drawable(flights, self.scenario):
            file, scenario = self.run.path / FLIGHTS_FILE, self.scenario
            accepted = f"flights over {scenario.num_ues} UEs"
            if scenario.num_helpers > 1:
                accepted += f" by {scenario.num_helpers} helpers"
            raise InputError(f"{file}: expected {accepted}")
        return flights

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The evaluation over the scenario's own horizon, or whichever was asked for last.

        Raises:
            InputError: there is none, or the file is damaged.
        """
        return read_evaluation(self.run.path)

    @property
    def flown(self) -> Scenario:
        """The scenario with the horizon that was evaluated."""
        return dataclasses.replace(self.scenario, num_slots=self.summary["num_slots"])

    def horizons(self) -> pd.DataFrame:
        """What each scheme and optimum earns over each horizon, as :func:`horizon_table` tells it.

        Raises:
            InputError: there are evaluations over fewer than two.
        """
        further = evaluation_directories(self.run.path)[1:]
        read = [*map(read_evaluation, filter(_is_evaluated, further)), self.summary]
        by_horizon = {summary["num_slots"]: summary for summary in read}
        if len(by_horizon) < 2:
            raise InputError("it takes evaluations over two horizons or more (num_slots=[10,20])")
        return horizon_table(by_horizon.values())

    def learning(self) -> pd.DataFrame:
        """The learning curves of the trainings on the scenario, as :func:`learning_table` has them.

        Raises:
            InputError: a table of metrics is missing or damaged, or has no such learners.
        """
        tables = []
        for training, run in self._trainings().items():
            if not run.metrics_file.exists():
                raise InputError(f"there is no {run.metrics_file.name} in {run.path}")
            metrics = readable_metrics(run.metrics_file)
            if metrics.empty:
                metrics = run.metrics()  # which refuses what is no table
            own = metrics[metrics["num_slots"] == self.scenario.num_slots]
            curves = list(learning_curves(own[own["scheme"].isin(LEARNED)]))
            if curves:
                tables.append(learning_table(curves, self._references(), training))
        if not tables:
            raise InputError(f"no learner has the scenario's T = {self.scenario.num_slots}")
        table = pd.concat(tables, ignore_index=True)
        table.attrs["unit"] = self._unit
        table.attrs[NO_HELPER] = self._references().get(NO_HELPER)
        return table

    def _trainings(self) -> dict[str, RunDirectory]:
        """By what they are called."""
        trainings = {label(self.run.configuration().algorithm_name): self.run}
        paper = RunDirectory(self.run.path / AS_IN_PAPER)
        if paper.config_file.exists():
            trainings[f"{label(paper.configuration().algorithm_name)}, as in the paper"] = paper
        return trainings

    def _references(self) -> dict[str, float]:
        """Over the scenario's horizon: empty where that was not evaluated."""
        if not _is_evaluated(self.run.path):
            return {}
        is_own = self.summary["num_slots"] == self.scenario.num_slots
        return references_of(self.summary) if is_own else {}


def _is_evaluated(directory: Path) -> bool:
    return (directory / EVALUATION_FILE).exists()


def horizon_table(summaries: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """What each scheme and optimum earns over each horizon.

    Args:
        summaries: of evaluations, as :attr:`Evaluation.summary`, one for each horizon.

    Returns:
        ``scheme``, ``num_slots``, ``learners``, ``episodes``; the ``mean`` of what was earned, the
        secrecy sum-rate or another reward, and its 95 % interval ``low`` to ``high``. Its ``attrs``
        tell the ``title`` of what was earned.
    """
    rows, title = [], ""
    for summary in sorted(summaries, key=lambda summary: int(summary["num_slots"])):
        title = earned_title(summary)
        for scheme in (*DRAWN, *BEST):
            if scheme in summary["schemes"]:
                result = summary["schemes"][scheme]
                rate = earned(result)
                rows.append(
                    {
                        "scheme": scheme,
                        "num_slots": summary["num_slots"],
                        "learners": result["learners"],
                        "episodes": summary["episodes"],
                        "mean": rate["mean"],
                        "low": rate["ci95"][0],
                        "high": rate["ci95"][1],
                    }
                )
    table = pd.DataFrame(rows)
    table.attrs["title"] = title
    return table


def evaluations(directory: Path, scenario: Scenario | None) -> list[Evaluation]:
    """Those that can be read, one for each horizon: the scenario's own, then the shortest first.

    One whose flights cannot be read has none.
    """
    found: dict[int, Evaluation] = {}
    for place in evaluation_directories(directory):
        summary, flights = readable_evaluation(place), readable_flights(place)
        if summary is not None:
            evaluation = Evaluation(summary, pd.DataFrame() if flights is None else flights)
            found.setdefault(summary["num_slots"], evaluation)
    return [found[horizon] for horizon in own_first(found, scenario)]


def own_first(horizons: Iterable[int], scenario: Scenario | None) -> list[int]:
    """Horizons in order, the scenario's own before the others."""
    own = None if scenario is None else scenario.num_slots
    return sorted(horizons, key=lambda horizon: (horizon != own, horizon))


def readable_scenario(values: object) -> tuple[str, Scenario | None]:
    """A scenario and its name, as :func:`named_scenario` reads them; None where it cannot."""
    try:
        return named_scenario(values)
    except InputError:
        return "unknown", None


def evaluated_scenario(summary: Mapping[str, Any]) -> tuple[str, Scenario | None]:
    """The scenario of an evaluation and its name; None where it cannot be read."""
    parameters = summary.get("parameters")
    fields = parameters if isinstance(parameters, dict) else {}
    return readable_scenario({"name": summary.get("scenario", "unknown"), **fields})


def all_metrics(directory: Path) -> pd.DataFrame:
    """Of the run, and of the paper's own algorithm where it was trained beside it."""
    own, paper = RunDirectory(directory), RunDirectory(directory / AS_IN_PAPER)
    rows = [
        readable_metrics(run.metrics_file).replace({"scheme": names})
        for run, names in ((own, LEARNED), (paper, LEARNED_AS_IN_PAPER))
    ]
    return pd.concat([table for table in rows if len(table)] or rows[:1], ignore_index=True)
