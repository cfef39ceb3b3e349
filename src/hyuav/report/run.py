"""The report of a run: what it learned and how its schemes fly."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from hyuav.errors import InputError
from hyuav.evaluation import LABELS, MODE_RULES, OPTIMA, EvaluationParameters, Policy, evaluate
from hyuav.experiment import LEARNED, LEARNED_AS_IN_PAPER, LINEAR, learned_policies
from hyuav.report.curves import QUANTITIES, learning_figure
from hyuav.report.html import Page, Picture, Section
from hyuav.report.maps import HEIGHT, TITLES, sum_rate_map
from hyuav.report.player import flight_player
from hyuav.report.reading import readable_config, readable_evaluation, readable_flights
from hyuav.report.tables import configuration_tables, scheme_table
from hyuav.runs import RunDirectory, named_scenario, readable_metrics
from hyuav.scenario import Scenario

AS_IN_PAPER = "as_in_paper"
"""Where the main job keeps the training by the paper's own algorithm, beside its own."""

QUICK = EvaluationParameters(episodes=100, flights=1)
"""How runs are flown that nobody has evaluated."""

PLAYER_HEIGHT, CURVES_HEIGHT = 740, 460


@dataclasses.dataclass(frozen=True)
class _Flown:
    """What is known of flights, from an evaluation or flown for the report."""

    scenario: Scenario
    summary: dict[str, Any]
    flights: pd.DataFrame
    note: str


def run_page(directory: Path) -> Page:
    """What a run directory tells, however much of it is there yet."""
    config = readable_config(directory)
    name, scenario = _scenario(config)
    metrics, evaluation = _metrics(directory), readable_evaluation(directory)
    if scenario is None and evaluation is not None:  # kept apart from its runs
        name, scenario = _scenario({"scenario": _named(evaluation)})
    flown, failure = _flown(directory, name, scenario, evaluation)
    summary = evaluation if flown is None else flown.summary
    sections = [
        _flights(flown, failure),
        _curves(metrics, summary),
        _schemes(summary, [flown.note] if flown and summary is not evaluation else []),
        map_section({name: scenario} if scenario else {}),
        config_section(config),
    ]
    return Page("Run", directory.resolve().name, _facts(config, name, scenario, metrics), sections)


def _named(evaluation: Mapping[str, Any]) -> dict[str, Any]:
    parameters = evaluation.get("parameters")
    fields = parameters if isinstance(parameters, dict) else {}
    return {"name": evaluation.get("scenario", "unknown"), **fields}


def _scenario(config: Mapping[str, Any]) -> tuple[str, Scenario | None]:
    try:
        return named_scenario(config.get("scenario"))
    except InputError:
        return "unknown", None


def _metrics(directory: Path) -> pd.DataFrame:
    """Of the run, and of the paper's own algorithm where it was trained beside it."""
    own = RunDirectory(directory)
    paper = RunDirectory(directory / AS_IN_PAPER)
    rows = [
        readable_metrics(run.metrics_file).replace({"scheme": names})
        for run, names in ((own, LEARNED), (paper, LEARNED_AS_IN_PAPER))
    ]
    return pd.concat([table for table in rows if len(table)] or rows[:1], ignore_index=True)


def _facts(
    config: Mapping[str, Any], name: str, scenario: Scenario | None, metrics: pd.DataFrame
) -> dict[str, str]:
    facts = {"Scenario": name}
    if scenario is not None:
        facts["UEs"] = str(scenario.num_ues)
    for title, section, entry in (
        ("Algorithm", "algorithm", "name"),
        ("Episodes asked for", "training", "num_episodes"),
    ):
        values = config.get(section)
        if isinstance(values, Mapping) and entry in values:
            facts[title] = str(values[entry])
    if len(metrics):
        facts["Episodes done"] = f"{metrics['episode'].max():.0f}"
        facts["Learners"] = str(len(metrics[["learner", "scheme"]].drop_duplicates()))
        facts["Slots per episode"] = ", ".join(
            f"{slots:.0f}" for slots in sorted(metrics["num_slots"].dropna().unique())
        )
    return facts


def _flown(
    directory: Path,
    name: str,
    scenario: Scenario | None,
    evaluation: dict[str, Any] | None,
) -> tuple[_Flown | None, str]:
    """The flights of the evaluation, or else some flown now; and why there are none."""
    flights = readable_flights(directory)
    if flights is not None and evaluation is not None:
        _, flown = _scenario({"scenario": _named(evaluation)})
        if flown is None:
            return None, "The evaluation's scenario cannot be read."
        note = "Flights of the evaluation, each scheme's first."
        return _Flown(flown, evaluation, flights, note), ""
    if scenario is None:
        return None, "There is no configuration to fly by."
    run = RunDirectory(directory)
    if not run.best_checkpoint.is_file():
        return None, "There are no weights to fly by yet."
    try:
        return _fly(run, name), ""
    except InputError as error:
        return None, f"The weights cannot be flown: {error}"


def _fly(run: RunDirectory, name: str) -> _Flown:
    """Fly the best weights and the straight flights through a few episodes."""
    configuration = run.configuration()
    scenario = configuration.scenario
    horizons = [learner.num_slots or scenario.num_slots for learner in configuration.learners]
    if scenario.num_slots not in horizons:
        scenario = dataclasses.replace(scenario, num_slots=max(horizons))
    policies = learned_policies([run], scenario)
    for scheme, straight in LINEAR.items():
        try:
            policies[scheme] = [Policy(straight(scenario))]
        except InputError:  # too fast for the horizon
            continue
    evaluation = evaluate(scenario, name, policies, QUICK)
    note = (
        f"Nothing was evaluated yet: for this report, the best weights so far and the straight "
        f"references were flown through {QUICK.episodes} episodes."
    )
    return _Flown(scenario, evaluation.summary, evaluation.flights, note)


def _flights(flown: _Flown | None, failure: str) -> Section:
    if flown is None:
        return Section("Flights", [failure])
    schemes = dict.fromkeys(flown.flights["scheme"])
    figures, notes = {}, [flown.note]
    for scheme in sorted(schemes, key=lambda own: list(LABELS).index(own) if own in LABELS else 99):
        label = LABELS.get(scheme, str(scheme))
        try:
            figures[label] = flight_player(flown.scenario, flown.flights, scheme)
        except InputError as error:
            notes.append(f"{label} is left out: {error}")
    notes.append(
        "Move the slider, or play. Filled UEs offload; lines show the links that are alive in the "
        "slot. The thin lines over the sum-rates are what relaying (solid) and jamming (dashed) "
        "would have brought."
    )
    pictures = [Picture("Flight", figures, PLAYER_HEIGHT)] if figures else []
    return Section("Flights", notes, pictures)


def _curves(metrics: pd.DataFrame, summary: Mapping[str, Any] | None) -> Section:
    if not len(metrics):
        return Section("Learning curves", ["No episode was logged yet."])
    earned = {} if summary is None else summary["schemes"]
    optima = {
        scheme: earned[optimum]["secrecy_sum_rate"]["mean"]
        for scheme, rule in MODE_RULES.items()
        if (optimum := OPTIMA[rule]) in earned
    }
    horizons = sorted(metrics["num_slots"].dropna().unique())
    figures = {
        title + (f", T = {horizon:.0f}" if len(horizons) > 1 else ""): learning_figure(
            own, optima if summary and summary["num_slots"] == horizon else None, quantity
        )
        for horizon in horizons
        for own in [metrics[metrics["num_slots"] == horizon]]
        for quantity, title in QUANTITIES.items()
        if own[quantity].notna().any()
    }
    if not figures:
        return Section("Learning curves", ["No episode was logged yet."])
    return Section("Learning curves", (), [Picture("Quantity", figures, CURVES_HEIGHT)])


def _schemes(summary: Mapping[str, Any] | None, notes: Sequence[str]) -> Section:
    if summary is None:
        return Section("Schemes", ["There is no evaluation yet."])
    return Section("Schemes", notes, tables=[scheme_table(summary)])


def map_section(scenarios: Mapping[str, Scenario]) -> Section:
    """Maps of the secrecy sum-rate in each mode."""
    if not scenarios:
        return Section("Maps", ["There is no scenario that can be read."])
    pictures = [
        Picture(
            f"{title}, {name}",
            {"": sum_rate_map(scenario, mode, scenario.map_side / 100).update_layout(title=None)},
            HEIGHT,
            small=True,
        )
        for name, scenario in scenarios.items()
        for mode, title in TITLES.items()
    ]
    notes = [
        "The secrecy sum-rate of one slot at every position of the helper, without fading. The "
        "white line separates where relaying is better from where jamming is; the dotted circle "
        "is the coverage of the legitimate UAV."
    ]
    return Section("Maps", notes, pictures)


def config_section(config: Mapping[str, Any]) -> Section:
    """All that was asked for."""
    if not config:
        return Section("Configuration", ["There is no config.yaml that can be read."])
    return Section("Configuration", tables=[configuration_tables(config)])
