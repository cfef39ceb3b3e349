"""The report of a comparison: how near to the optimum each algorithm comes."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from hyuav._support.errors import InputError
from hyuav.experiments.comparison.plan import LAYOUT, Compare
from hyuav.experiments.comparison.shards import CURVES_FILE, RESULTS_FILE
from hyuav.experiments.comparison.statistics import summarize_algorithms, summarize_cells
from hyuav.experiments.comparison.tables import label, stopped
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.policies import learned_policies
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.schemes import LABELS
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.reading import readable_config, readable_table
from hyuav.viz.html.curves import comparison_figures
from hyuav.viz.html.html import Page, Picture, Section
from hyuav.viz.html.player import flight_player
from hyuav.viz.html.run import PLAYER_HEIGHT, config_section, map_section
from hyuav.viz.html.tables import algorithms_table, cells_table

MAX_FLIGHTS, MAX_MAPS = 8, 2
"""Of a report: of the longest horizon, and of the presets before random layouts."""

_IDENTITY = {"algorithm", "scenario", "scheme", "num_slots", "seed"}
_RESULTS = {"fraction", "episodes_to_threshold", "seconds_to_threshold", "seconds"} | _IDENTITY
_CURVES = {"episode", "fraction"} | _IDENTITY
_TITLES = ("Share of the optimum", "Learning curves", "Performance profiles")
_FEW = EvaluationParameters(episodes=2, flights=1)


def comparison_page(directory: Path) -> Page:
    """What a comparison's directory tells, however much of it is there yet."""
    config = readable_config(directory)
    threshold, asked = _threshold(config), _Asked.of(config)
    results, curves = (
        _rows(directory, name, columns, asked)
        for name, columns in ((RESULTS_FILE, _RESULTS), (CURVES_FILE, _CURVES))
    )
    runs = sorted(_trained(directory), key=asked.flown)
    sections = [
        *_results(results, curves, threshold),
        _flights(runs[:MAX_FLIGHTS]),
        map_section(dict(list(_scenarios(runs).items())[:MAX_MAPS])),
        config_section(config),
    ]
    facts = {"Share that counts as solved": f"{100 * threshold:g} %"}
    if results is not None:
        facts["Algorithms"] = ", ".join(label(str(name)) for name in results["algorithm"].unique())
        facts["Scenarios"] = str(results["scenario"].nunique())
        facts["Slots per episode"] = ", ".join(map(str, sorted(results["num_slots"].unique())))
        facts["Learners"] = str(len(results))
    return Page("Comparison", directory.resolve().name, facts, sections)


def _threshold(config: Mapping[str, Any]) -> float:
    value = config.get("threshold")
    return float(value) if isinstance(value, int | float) and 0 <= value <= 1 else 0.97


class _Asked(NamedTuple):
    """The order in which a comparison was asked for; what is unknown comes last."""

    entries: Sequence[str] = ()
    scenarios: Sequence[str] = ()
    horizons: Sequence[int] = ()

    @classmethod
    def of(cls, config: Mapping[str, Any]) -> "_Asked":
        """Of a comparison's ``config.yaml``, which may be damaged or of another version."""
        names = [field.name for field in dataclasses.fields(Compare)]
        try:
            asked = Compare.from_dict({name: config[name] for name in names if name in config})
        except InputError:
            return cls()
        return cls(asked.entries, asked.scenario, asked.num_slots)

    def place(self, table: pd.DataFrame) -> tuple[int, int, int]:
        """Of a training's table."""
        algorithm, scenario, num_slots = table[["algorithm", "scenario", "num_slots"]].iloc[0]
        return (
            _index(self.entries, algorithm),
            _index(self.scenarios, scenario),
            _index(self.horizons, num_slots),
        )

    def flown(self, trained: tuple[str, RunDirectory, RunConfiguration]) -> tuple[Any, ...]:
        """Of a training's flight: the longest horizons first, and presets before layouts."""
        entry, _, configuration = trained
        name = configuration.scenario_name
        return (
            name.startswith(LAYOUT),
            -configuration.scenario.num_slots,
            _index(self.scenarios, name),
            name,
            _index(self.entries, entry),
        )


def _index(values: Sequence[Any], value: object) -> int:
    told = [str(own) for own in values]
    return told.index(str(value)) if str(value) in told else len(told)


def _rows(directory: Path, name: str, columns: set[str], asked: _Asked) -> pd.DataFrame | None:
    """A table of all finished trainings, or what was gathered of them."""
    paths = [path / name for path in _finished(directory)] or [directory / name]
    read = (readable_table(path, columns) for path in paths)
    tables = sorted((table for table in read if table is not None), key=asked.place)
    return pd.concat(tables, ignore_index=True) if tables else None


def _finished(directory: Path) -> list[Path]:
    return sorted(path.parent for path in directory.glob(f"shards/*/{RESULTS_FILE}"))


def _results(
    results: pd.DataFrame | None, curves: pd.DataFrame | None, threshold: float
) -> Iterator[Section]:
    if results is None or curves is None:
        yield Section("Results", ["No training is finished yet."])
        return
    cells = summarize_cells(results, threshold)
    figures = comparison_figures(results, curves, cells, threshold)
    for title, (name, figure) in zip(_TITLES, figures.items(), strict=True):
        yield Section(title, (), [Picture(name, {"": figure}, int(figure.layout.height))])
    algorithms = summarize_algorithms(results, threshold)
    tables = [algorithms_table(algorithms, threshold), cells_table(cells, threshold)]
    yield Section("Results", stopped(results), (), tables)


def _trained(directory: Path) -> Iterator[tuple[str, RunDirectory, RunConfiguration]]:
    """The finished trainings whose weights are kept, with what is compared in each."""
    for path in _finished(directory):
        run = RunDirectory(path)
        try:
            configuration = run.configuration()
        except InputError:
            continue
        horizon = f"_T{configuration.scenario.num_slots}"
        entry = path.name.partition(f"_{configuration.scenario_name}{horizon}")[0]
        if run.best_checkpoint.is_file():
            yield entry, run, configuration


def _scenarios(
    runs: list[tuple[str, RunDirectory, RunConfiguration]],
) -> dict[str, Scenario]:
    return {
        configuration.scenario_name: configuration.scenario
        for _, _, configuration in reversed(runs)
    }


def _flights(runs: list[tuple[str, RunDirectory, RunConfiguration]]) -> Section:
    """A flight of each algorithm's first learner."""
    figures, notes = {}, []
    for entry, run, configuration in runs:
        scenario, name = configuration.scenario, configuration.scenario_name
        try:
            policies = learned_policies([run], scenario)
            scheme = next(scheme for scheme in LABELS if scheme in policies)
            evaluation = evaluate(scenario, name, {scheme: policies[scheme]}, _FEW)
        except InputError as error:
            notes.append(f"{run.path.name} is left out: {error}")
            continue
        text = f"{label(entry)}, {name}, T = {scenario.num_slots}, {LABELS[scheme]}"
        figures[text] = flight_player(scenario, evaluation.flights, scheme)
    if not figures:
        return Section("Flights", notes or ["There are no weights to fly by yet."])
    notes.append(
        "The best weights of each algorithm's first learner, flown for this report; of the longest "
        f"horizons, and at most {MAX_FLIGHTS}."
    )
    return Section("Flights", notes, [Picture("Flight", figures, PLAYER_HEIGHT)])
