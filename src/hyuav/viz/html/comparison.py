"""The report of a comparison: how near to the optimum each algorithm comes."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from hyuav._support.errors import InputError
from hyuav._support.formatting import percent
from hyuav.experiments.comparison.statistics import summarize_algorithms, summarize_cells
from hyuav.experiments.comparison.tables import label, stopped, upper_bounds
from hyuav.viz.data.comparison import ReadableComparison, TrainedEntry
from hyuav.viz.data.flying import fly_first_learner
from hyuav.viz.data.schemes import scheme_label
from hyuav.viz.html.comparison_figures import comparison_figures
from hyuav.viz.html.document import Page, Picture, Section
from hyuav.viz.html.player import plain_player
from hyuav.viz.html.run import config_section, map_section
from hyuav.viz.html.tables import algorithms_table, cells_table

MAX_FLIGHTS, MAX_MAPS = 8, 2
"""Of a report: of the longest horizon, and of the presets before random layouts."""


def comparison_page(directory: Path) -> Page:
    """What a comparison's directory tells, however much of it is there yet."""
    comparison = ReadableComparison(directory)
    threshold, results, runs = comparison.threshold, comparison.results, comparison.trained()
    scenarios = {trained.scenario_name: trained.scenario for _, _, trained in reversed(runs)}
    sections = [
        *_results(results, comparison.curves, threshold),
        _flights(runs[:MAX_FLIGHTS]),
        map_section(dict(list(scenarios.items())[:MAX_MAPS])),
        config_section(comparison.config),
    ]
    facts = {"Share that counts as solved": percent(threshold, None)}
    if results is not None:
        facts["Algorithms"] = ", ".join(label(str(name)) for name in results["algorithm"].unique())
        facts["Scenarios"] = str(results["scenario"].nunique())
        facts["Slots per episode"] = ", ".join(map(str, sorted(results["num_slots"].unique())))
        facts["Learners"] = str(len(results))
    return Page("Comparison", directory.resolve().name, facts, sections)


def _results(
    results: pd.DataFrame | None, curves: pd.DataFrame | None, threshold: float
) -> Iterator[Section]:
    if results is None or curves is None:
        yield Section("Results", ["No training is finished yet."])
        return
    cells = summarize_cells(results, threshold)
    for title, name, figure in comparison_figures(results, curves, cells, threshold):
        yield Section(title, (), [Picture(name, {"": figure})])
    algorithms = summarize_algorithms(results, threshold)
    tables = [algorithms_table(algorithms, threshold), cells_table(cells, threshold)]
    notes = [*upper_bounds(results), *stopped(results)]
    yield Section("Results", notes, (), tables)


def _flights(runs: Sequence[TrainedEntry]) -> Section:
    """A flight of each algorithm's first learner."""
    figures, notes = {}, []
    for entry, run, configuration in runs:
        scenario, name = configuration.scenario, configuration.scenario_name
        try:
            scheme, evaluation = fly_first_learner(run, configuration)
        except InputError as error:
            notes.append(f"{run.path.name} is left out: {error}")
            continue
        text = f"{label(entry)}, {name}, T = {scenario.num_slots}, {scheme_label(scheme)}"
        figures[text] = plain_player(scenario, evaluation.flights, scheme)
    if not figures:
        return Section("Flights", notes or ["There are no weights to fly by yet."])
    notes.append(
        "The best weights of each algorithm's first learner, flown for this report; of the longest "
        f"horizons, and at most {MAX_FLIGHTS}."
    )
    return Section("Flights", notes, [Picture("Flight", figures)])
