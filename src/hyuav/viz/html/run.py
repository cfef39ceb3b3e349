"""The report of a run: what it learned and how its schemes fly."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from hyuav._support.errors import InputError
from hyuav.envs.rewards import SUM_RATE
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import LEARNED_AS_IN_PAPER
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.curves import SMOOTHING, axis_title
from hyuav.viz.data.flights import flying_schemes
from hyuav.viz.data.flying import QUICK, fly_now
from hyuav.viz.data.maps import helper_map
from hyuav.viz.data.reading import readable_config, references_of, unit_of
from hyuav.viz.data.runs import (
    all_metrics,
    evaluated_scenario,
    evaluations,
    own_first,
    readable_scenario,
)
from hyuav.viz.data.schemes import scheme_label
from hyuav.viz.html.curves import MAX_POINTS, QUANTITIES, learning_figure
from hyuav.viz.html.document import Page, Picture, Section
from hyuav.viz.html.maps import TITLES, map_figure
from hyuav.viz.html.player import plain_player
from hyuav.viz.html.tables import configuration_tables, scheme_table

_KEPT = "Flights of the evaluation, each scheme's first."
_FLOWN_NOW = (
    "Nothing was evaluated yet: for this report, the best weights so far and the straight "
    f"references were flown through {QUICK.episodes} episodes."
)


def run_page(directory: Path) -> Page:
    """What a run directory tells, however much of it is there yet."""
    config = readable_config(directory)
    name, scenario = readable_scenario(config.get("scenario"))
    metrics, evaluated = all_metrics(directory), evaluations(directory, scenario)
    if scenario is None and evaluated:  # kept apart from its runs
        name, scenario = evaluated_scenario(evaluated[0].summary)
    flown, note = _flown(directory, name, scenario, evaluated)
    summaries = [own.summary for own in evaluated or [own for _, own in flown]]
    sections = [
        _flights(flown, note),
        _curves(metrics, summaries, scenario, unit_of(config)),
        _schemes(summaries, [] if evaluated or not flown else [note]),
        map_section({name: scenario} if scenario else {}),
        config_section(config),
    ]
    return Page("Run", directory.resolve().name, _facts(config, name, scenario, metrics), sections)


def _facts(
    config: Mapping[str, Any], name: str, scenario: Scenario | None, metrics: pd.DataFrame
) -> dict[str, str]:
    facts = {"Scenario": name}
    if scenario is not None:
        facts["UEs"] = str(scenario.num_ues)
        if scenario.num_helpers > 1:
            facts["Helpers"] = str(scenario.num_helpers)
        if scenario.num_eavesdroppers > 1:
            kind = scenario.eavesdroppers
            facts["Eavesdroppers"] = f"{scenario.num_eavesdroppers}, {kind}"
    for title, section, entry in (
        ("Algorithm", "algorithm", "name"),
        ("Episodes asked for", "training", "num_episodes"),
    ):
        values = config.get(section)
        if isinstance(values, Mapping) and entry in values:
            facts[title] = str(values[entry])
    if isinstance(reward := config.get("reward"), str) and reward != SUM_RATE:
        facts["Reward"] = reward
    if len(metrics):
        facts["Episodes done"] = f"{metrics['episode'].max():.0f}"
        facts["Learners"] = str(len(metrics[["learner", "scheme"]].drop_duplicates()))
        facts["Slots per episode"] = ", ".join(
            f"{slots:.0f}" for slots in sorted(metrics["num_slots"].dropna().unique())
        )
    return facts


def _flown(
    directory: Path, name: str, scenario: Scenario | None, evaluated: Sequence[Evaluation]
) -> tuple[list[tuple[Scenario, Evaluation]], str]:
    """The flights of the evaluations, or else some flown now; and what is to be said of them."""
    kept = [own for own in evaluated if len(own.flights)]
    if kept:
        scenarios = [evaluated_scenario(own.summary)[1] for own in kept]
        both = zip(scenarios, kept, strict=True)
        flown = [(of, own) for of, own in both if of is not None]
        return flown, _KEPT if flown else "The evaluation's scenario cannot be read."
    if scenario is None:
        return [], "There is no configuration to fly by."
    run = RunDirectory(directory)
    if not run.best_checkpoint.is_file():
        return [], "There are no weights to fly by yet."
    try:
        return [fly_now(run, name)], _FLOWN_NOW
    except InputError as error:
        return [], f"The weights cannot be flown: {error}"


def _flights(several: Sequence[tuple[Scenario, Evaluation]], note: str) -> Section:
    if not several:
        return Section("Flights", [note])
    figures, notes = {}, [note]
    for scenario, flown in several:
        horizon = f"T = {scenario.num_slots}: " if len(several) > 1 else ""
        for scheme in flying_schemes(flown.flights):
            label = f"{horizon}{scheme_label(scheme)}"
            try:
                figures[label] = plain_player(scenario, flown.flights, scheme)
            except InputError as error:
                notes.append(f"{label} is left out: {error}")
    notes.append(
        "Move the slider, or play. Filled UEs offload; lines show the links that are alive in the "
        "slot. The thin lines over the sum-rates are what relaying (solid) and jamming (dashed) "
        "would have brought."
    )
    pictures = [Picture("Flight", figures)] if figures else []
    return Section("Flights", notes, pictures)


def _curves(
    metrics: pd.DataFrame,
    summaries: Sequence[Mapping[str, Any]],
    scenario: Scenario | None,
    unit: str,
) -> Section:
    beside = {summary["num_slots"]: references_of(summary) for summary in summaries}
    horizons = own_first(metrics["num_slots"].dropna().unique(), scenario)
    figures = {
        axis_title(quantity, unit)
        + (f", T = {horizon:.0f}" if len(horizons) > 1 else ""): learning_figure(
            own, beside.get(int(horizon)), quantity, unit
        )
        for horizon in horizons
        for own in [metrics[metrics["num_slots"] == horizon]]
        for quantity in QUANTITIES
        if own[quantity].notna().any()
    }
    if not figures:
        return Section("Learning curves", ["No episode was logged yet."])
    notes = [
        "A line is the interquartile mean over the learners of a scheme, and the band its 95 % "
        "bootstrap interval; behind a single learner's line stands each episode's reward. The "
        f"accumulated rewards are means of {SMOOTHING} episodes, and more than {MAX_POINTS} points "
        "are averaged in groups. Dashed is what only jams, and dotted an optimum."
    ]
    if metrics["scheme"].isin(LEARNED_AS_IN_PAPER.values()).any():
        notes.append("The thinner, paler lines are learned by the paper's own algorithm.")
    return Section("Learning curves", notes, [Picture("Quantity", figures)])


def _schemes(summaries: Sequence[Mapping[str, Any]], notes: Sequence[str]) -> Section:
    if not summaries:
        return Section("Schemes", ["There is no evaluation yet."])
    return Section("Schemes", notes, tables=[scheme_table(summary) for summary in summaries])


def map_section(scenarios: Mapping[str, Scenario]) -> Section:
    """Maps of the secrecy sum-rate in each mode."""
    if not scenarios:
        return Section("Maps", ["There is no scenario that can be read."])
    pictures = [
        Picture(
            f"{title}, {name}",
            {"": map_figure(scenario, rates, mode).update_layout(title=None)},
            small=True,
        )
        for name, scenario in scenarios.items()
        for rates in [helper_map(scenario, scenario.map_side / 100)]
        for mode, title in TITLES.items()
    ]
    notes = [
        "The secrecy sum-rate of one slot at every position of the helper, without fading. On the "
        "map of the better mode, the solid white line goes around where relaying is better, the "
        "dashed one around where jamming is; elsewhere neither brings anything. The dotted circle "
        "is the coverage of the legitimate UAV."
    ]
    if any(scenario.num_helpers > 1 for scenario in scenarios.values()):
        notes.append("Where there are several helpers, it is what one of them brings alone.")
    return Section("Maps", notes, pictures)


def config_section(config: Mapping[str, Any]) -> Section:
    """All that was asked for."""
    if not config:
        return Section("Configuration", ["There is no config.yaml that can be read."])
    return Section("Configuration", tables=[configuration_tables(config)])
